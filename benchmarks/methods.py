"""All methods on the same pairs: similarities on chips, whole registrations beside peers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from groundtie.similarity.surface import SIMILARITIES

from .accuracy import CRASHED, REFUSED, VERDICTS
from .cases import KINDS, SAR_OPTICAL, SAR_SAR, image_size, read_cases
from .chips import CHIPS_PX, LIMITS_PX, OFFSETS_PX, RADIUS_PX, SPACING_PX, ChipCase, ChipShare
from .offsets import Scene
from .programs import PROGRAMS, SHIFTS_PX, TIME_LIMIT_S, Registration, WholeCase
from .simulated import SIZE_PX
from .simulations import Simulation
from .speed import NOT_INSTALLED, OWN
from .suites import Goal, Settings, SuiteResult, Table, run_cases

_DENSITIES = ("rural", "suburban")
_SAR_KINDS = (SAR_OPTICAL, SAR_SAR)
_OTHER_KINDS = tuple(kind for kind in KINDS if kind not in _SAR_KINDS)
_QUICK_KINDS = (SAR_OPTICAL, "optical-optical")

# Columns of the tables: groups of pairs.
_GROUPS = {
    "SAR, real": _SAR_KINDS,
    **{kind: (kind,) for kind in KINDS},
    **{f"simulated {density}": (density,) for density in _DENSITIES},
}
# Fewer groups for the programs' tables, which are longer.
_PROGRAM_GROUPS = {
    "SAR–optical, real": (SAR_OPTICAL,),
    "SAR–optical, simulated": _DENSITIES,
    "SAR–SAR": (SAR_SAR,),
    "Optical, infrared, day and night": _OTHER_KINDS,
}

_MOST_SEEDS = 3
_MOST_CHIPS = 100
_QUICK_CHIPS = 16

# Goal for fused similarity on the smallest chips of real SAR pairs, without support.
_FUSED = "fused"
_WANTED_SHARE = 0.76
_WANTED_LEAD = -0.03


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    scenes = choose_scenes(settings)
    most = _QUICK_CHIPS if settings.quick else _MOST_CHIPS
    cases = [*(ChipCase(scene, most) for scene in scenes), *map(WholeCase, scenes)]
    found = [record for part in run_cases(cases, settings.jobs) for record in part.records]
    shares = [record for record in found if isinstance(record, ChipShare)]
    runs = [record for record in found if isinstance(record, Registration)]
    return SuiteResult(
        "Methods: similarities on chips, whole registrations beside peers",
        [] if settings.quick else goals(shares),
        (
            *(share_table(shares, chip_px) for chip_px in CHIPS_PX),
            pair_table(shares),
            *(
                program_table(title, [r for r in runs if r.group in groups])
                for title, groups in _PROGRAM_GROUPS.items()
                if any(r.group in groups for r in runs)
            ),
            error_table(runs),
        ),
        [asdict(record) for record in found],
        _NOTES,
    )


_NOTES = (
    f"Chips: at most {_MOST_CHIPS} a pair (fewer of larger ones), every {SPACING_PX} px, "
    f"± {RADIUS_PX} px search, no support from neighbours. The input is resampled by the affine "
    f"truth and moved by {OFFSETS_PX[0]:g} to {OFFSETS_PX[1]:g} px each way; chance alone brings "
    f"{np.pi * LIMITS_PX[-1] ** 2 / (2 * RADIUS_PX + 1) ** 2:.1%} within {LIMITS_PX[-1]:g} px.",
    f"Registrations: from starts that are wrong by {SHIFTS_PX[0]:g} to {SHIFTS_PX[1]:g} px each "
    f"way, whole processes, at most {TIME_LIMIT_S:g} s. A program that says it found nothing, "
    "fails or takes longer has refused; only what it claims can be silently wrong.",
)


def choose_scenes(settings: Settings) -> list[Scene]:
    """Return the pairs: all real ones and some simulated ones, or just two small ones."""
    cases = read_cases(settings.data)
    if settings.quick:
        chosen = [
            min((c for c in cases if c.kind == kind), key=lambda c: max(image_size(c.reference)))
            for kind in _QUICK_KINDS
        ]
        return [Scene(case, settings.cache) for case in chosen]
    simulations = [
        Simulation(SIZE_PX, density, seed)
        for density in _DENSITIES
        for seed in settings.seed_numbers(_MOST_SEEDS)
    ]
    return [Scene(source, settings.cache) for source in (*cases, *simulations)]


def mean_share(
    shares: Sequence[ChipShare], similarity: str, chip_px: int, kinds: Sequence[str], limit: int
) -> float | None:
    """Return the mean over pairs of the share within a limit; None without chips."""
    found = [
        record.shares[limit]
        for record in shares
        if (record.similarity, record.chip_px) == (similarity, chip_px)
        and record.group in kinds
        and record.shares
    ]
    return float(np.mean(found)) if found else None


def share_table(shares: Sequence[ChipShare], chip_px: int) -> Table:
    """Return the shares of chips of one size by similarity and group of pairs."""
    there = {
        name: kinds for name, kinds in _GROUPS.items() if any(s.group in kinds for s in shares)
    }
    rows = []
    for similarity in SIMILARITIES:
        cells = []
        for kinds in there.values():
            means = [
                mean_share(shares, similarity, chip_px, kinds, limit)
                for limit in range(len(LIMITS_PX))
            ]
            cells.append(" / ".join("–" if m is None else f"{100 * m:.0f}" for m in means))
        times = [
            s.milliseconds
            for s in shares
            if (s.similarity, s.chip_px) == (similarity, chip_px) and s.chips
        ]
        rows.append([similarity, *cells, f"{np.median(times):.0f}" if times else "–"])
    limits = " / ".join(f"{limit:g}" for limit in LIMITS_PX)
    title = f"Chips of {chip_px} px: % within {limits} px, mean over pairs"
    return Table(title, ("similarity", *there, "ms a chip"), rows)


def pair_table(shares: Sequence[ChipShare]) -> Table:
    """Return for each pair the share of its smallest chips within the larger limit."""
    first = [s for s in shares if s.chip_px == CHIPS_PX[0] and s.shares]
    rows = []
    for name in dict.fromkeys(s.name for s in first):
        own = {s.similarity: s for s in first if s.name == name}
        chips = str(next(iter(own.values())).chips)
        rows.append([name, chips, *(f"{100 * own[s].shares[-1]:.0f}" for s in SIMILARITIES)])
    title = f"Chips of {CHIPS_PX[0]} px by pair: % within {LIMITS_PX[-1]:g} px"
    return Table(title, ("pair", "chips", *SIMILARITIES), rows)


def program_table(title: str, runs: Sequence[Registration]) -> Table:
    """Return the results of each program on a group of pairs, including those not installed."""
    rows = []
    for program in (OWN, *(program.name for program in PROGRAMS)):
        own = [run for run in runs if run.program == program]
        rows.append([program, *(_program_cells(own) if own else [NOT_INSTALLED, *["–"] * 10])])
    head = ("program", "runs", *VERDICTS, "median error (px)", "largest (px)", "median s")
    return Table(title, (*head, "processor s", "peak MB"), rows)


def _program_cells(runs: Sequence[Registration]) -> list[str]:
    errors = [run.error_px for run in runs if run.error_px is not None]
    processor = [r.processor_seconds for r in runs if r.processor_seconds is not None]
    peaks = [run.peak_bytes for run in runs if run.peak_bytes is not None]
    return [
        str(len(runs)),
        *(str(sum(run.verdict == verdict for run in runs)) for verdict in VERDICTS),
        f"{np.median(errors):.2f}" if errors else "–",
        f"{max(errors):.1f}" if errors else "–",
        f"{np.median([run.seconds for run in runs]):.1f}",
        f"{np.median(processor):.1f}" if processor else "–",
        f"{max(peaks) / 1e6:.0f}" if peaks else "–",
    ]


def error_table(runs: Sequence[Registration]) -> Table:
    """Return the error of each program that ran on each pair."""
    programs = [p for p in (OWN, *(p.name for p in PROGRAMS)) if any(r.program == p for r in runs)]
    rows = []
    for name in dict.fromkeys(run.name for run in runs):
        own = {run.program: run for run in runs if run.name == name}
        rows.append([name, *(_error_cell(own.get(program)) for program in programs)])
    return Table("Errors by pair (px)", ("pair", *programs), rows)


def _error_cell(run: Registration | None) -> str:
    if run is None:
        return "–"
    return run.verdict if run.verdict in (REFUSED, CRASHED) else f"{run.error_px:.1f}"


def goals(shares: Sequence[ChipShare]) -> tuple[Goal, ...]:
    """Return the goals of the fused similarity without support, with their results."""
    chip_px, limit = CHIPS_PX[0], len(LIMITS_PX) - 1
    mean = mean_share(shares, _FUSED, chip_px, _SAR_KINDS, limit)
    leads = {}
    for name in dict.fromkeys(s.name for s in shares if s.group in _SAR_KINDS):
        own = {
            s.similarity: s.shares[limit]
            for s in shares
            if s.name == name and s.chip_px == chip_px and s.shares
        }
        if own:
            leads[name] = own[_FUSED] - max(v for k, v in own.items() if k != _FUSED)
    if mean is None or not leads:
        return ()
    worst = min(leads, key=lambda name: leads[name])
    what = f"{_FUSED} on {chip_px} px chips of real SAR pairs"
    return (
        Goal(
            f"{what}, within {LIMITS_PX[limit]:g} px",
            f"at least {_WANTED_SHARE:.0%}",
            f"{mean:.1%}",
            mean >= _WANTED_SHARE,
        ),
        Goal(
            f"{what}, against the best other one on the worst pair",
            f"at least {100 * _WANTED_LEAD:+.0f} points",
            f"{100 * leads[worst]:+.1f} points ({worst})",
            leads[worst] >= _WANTED_LEAD,
        ),
    )
