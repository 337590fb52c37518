"""The suite of attacks: which cases are run, and their outcomes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence

import numpy as np

from ..accuracy import REFUSED, SILENTLY_WRONG, VERDICTS
from ..suites import Goal, Settings, SuiteResult, Table, of_classes, run_cases
from .cases import AttackCase, cases, named
from .catalogue import CONTROLS
from .sensors import SensorCase
from .tries import AttackOutcome

AnyCase = AttackCase | SensorCase

_WANTED_RUNS = 3000
# Most seeds of the whole suite: enough for the wanted runs. Samples and classes have no limit.
_SEEDS = 4
_QUICK = 20


def run(settings: Settings) -> SuiteResult:
    """Run the suite, or the cases that are named."""
    chosen = choose(settings)
    if settings.save is not None:
        for case in chosen:
            case.save(settings.save / case.name.replace("/", "_").replace(" ", "-"))
    outcomes: list[AttackOutcome] = list(run_cases(chosen, settings.jobs))
    attacks = [o for o in outcomes if o.group != CONTROLS]
    controls = [o for o in outcomes if o.group == CONTROLS]
    return SuiteResult(
        "Attacks: what deceives a registration",
        goals(attacks),
        (
            verdict_table("By group", outcomes, lambda o: o.group),
            verdict_table("By class", attacks, lambda o: f"{o.group}: {o.attack}"),
            verdict_table("Controls", controls, lambda o: f"{o.attack}"),
            verdict_table("Controls by kind and tool", controls, lambda o: f"{o.kind}, {o.tool}"),
            verdict_table("Attacks by tool", attacks, lambda o: o.tool),
            rules_table(outcomes),
            wrong_table(outcomes),
        ),
        [outcome.record() for outcome in outcomes],
        (
            "The error is what 90 % of the errors over the overlap do not exceed, in input pixels: "
            "silently wrong is what is accepted with more than a tenth of the overlap more than "
            "3 px wrong (beyond how far the truth can be believed), or though the images show "
            "different places. `--case` repeats one, `--save` keeps its images.",
        ),
    )


def choose(settings: Settings, tools: Collection[str] | None = None) -> list[AnyCase]:
    """Return the cases that the settings ask for, on the given tools; None: on all."""

    def is_asked(case: AnyCase) -> bool:
        return tools is None or case.tool in tools

    if settings.named:
        every = (named(name, settings.data, settings.cache) for name in settings.named)
        return list(filter(is_asked, every))
    is_whole = not (settings.sample or settings.classes)
    number = min(settings.seeds, _SEEDS) if is_whole else settings.seeds
    seeds = range(settings.first_seed, settings.first_seed + number)
    asked = filter(is_asked, cases(seeds, settings.data, settings.cache, settings.large))
    some = of_classes(list(asked), settings.classes, lambda case: {case.attack, case.group})
    wanted = _QUICK if settings.quick else settings.sample
    return some if wanted is None else sample(some, wanted)


def sample(every: Sequence[AnyCase], number: int) -> list[AnyCase]:
    """Return a reproducible sample of the cases with about equally many of every class.

    One of each class comes first, so that a run that is stopped early is a sample, too.
    """
    turn: Counter[str] = Counter()
    ranked = []
    for place, index in enumerate(np.random.default_rng(len(every)).permutation(len(every))):
        ranked.append((turn[every[index].attack], place, index))
        turn[every[index].attack] += 1
    return [every[index] for _, _, index in sorted(ranked)[:number]]


def goals(attacks: Sequence[AttackOutcome]) -> tuple[Goal, ...]:
    """Return the goal and its result."""
    wrong = sum(o.verdict == SILENTLY_WRONG for o in attacks)
    reached = False if wrong else (True if len(attacks) >= _WANTED_RUNS else None)
    return (
        Goal(
            "Silently wrong", f"0 of at least {_WANTED_RUNS}", f"{wrong} of {len(attacks)}", reached
        ),
    )


def verdict_table(
    title: str, outcomes: Sequence[AttackOutcome], key: Callable[[AttackOutcome], str]
) -> Table:
    """Return the number of outcomes with each verdict, by key."""
    rows = []
    for name in sorted({key(outcome) for outcome in outcomes}):
        some = [outcome for outcome in outcomes if key(outcome) == name]
        counts = Counter(outcome.verdict for outcome in some)
        seconds = np.mean([outcome.seconds for outcome in some])
        cells = (str(counts[verdict]) for verdict in VERDICTS)
        rows.append([name, str(len(some)), *cells, f"{seconds:.1f}"])
    return Table(title, ("", "tried", *VERDICTS, "mean s"), rows)


def rules_table(outcomes: Sequence[AttackOutcome]) -> Table:
    """Return the rules that refused attacks and controls."""
    refused = [outcome for outcome in outcomes if outcome.verdict == REFUSED]
    counts = Counter((o.rule or "no rule", o.group == CONTROLS) for o in refused)
    names = sorted({rule for rule, _ in counts})
    rows = [[name, str(counts[name, False]), str(counts[name, True])] for name in names]
    return Table("Rules that refused", ("rule", "attacks", "controls"), rows)


def wrong_table(outcomes: Sequence[AttackOutcome]) -> Table:
    """Return the silently wrong results, with the names by which they can be repeated."""
    rows = [
        [f"`{o.name}`", f"{o.error_px:.1f}", f"{o.claimed_ce90_px:.2f}", o.note]
        for o in outcomes
        if o.verdict == SILENTLY_WRONG
    ]
    return Table("Silently wrong", ("case", "error (px)", "claimed CE90 (px)", "what"), rows)
