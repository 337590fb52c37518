"""Margins of right and wrong transforms against the limits of the rules on the survey.

The truth shows whether a transform is right, whatever the verdict. The limits of the rules derive
from the survey's statistics of right and wrong transforms: this suite is their source.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.errors import GroundTieError
from groundtie.geometry.judging import RIVAL_HEIGHT
from groundtie.kinds import plain
from groundtie.matching.parts import LEAST_EXCESS, find_parts
from groundtie.matching.shared_content import Sensors
from groundtie.matching.survey import Survey
from groundtie.matching.surveys import Rest
from groundtie.registration.evidence import RegistrationEvidence
from groundtie.registration.registration import Registration
from groundtie.registration.rules.survey import (
    EVEN_PEAK_DEVIATIONS,
    LEAST_POSITIVE,
    MOST_NEGATIVE,
    PEAK_DEVIATIONS,
    REST_PEAK_DEVIATIONS,
    STRIPES_IN_PLACE,
    WEAK_HEIGHT,
    deviations_elsewhere,
    deviations_of_rest,
    deviations_of_unexplained,
    has_few_chips,
    height_of_else,
)
from groundtie.registration.specification import COREGISTER, OPTICAL, SAR_SAR
from groundtie.registration.verdict import refusals
from groundtie.similarity.in_common import FINE_COHERENCE, LEAST_BRIGHTER, MOVED_GROUND_SHARE

from .accuracy import SILENTLY_WRONG_PX
from .attacks.cases import AttackCase
from .attacks.suite import choose
from .attempt import on_pixels
from .cases import RealCase, draw_shift, read_cases, search_radius_m, write_case
from .pipeline_runs import found_by
from .real import LARGEST_SHIFT_PX
from .suites import Settings, SuiteResult, Table, run_cases

# Specification by tool.
_SPECIFICATIONS = {"coregister": COREGISTER, "match_sar_sar": SAR_SAR, "match_optical": OPTICAL}

_QUICK, _SAMPLE = 10, 200
_PERCENT = (0, 5, 50, 95, 100)


@dataclass(frozen=True)
class Statistic:
    """A statistic that a rule compares with its limit, which is an upper or a lower one."""

    name: str
    limit: float
    of: Callable[[RegistrationEvidence], float]
    is_refused_above: bool = True


def _excess(survey: Survey) -> float:
    """Return the excess of the most evident part, evident or not; NaN: too few chips."""
    parts = find_parts(survey.grid, survey.centres, survey.surfaces, -math.inf)
    return next((part.excess for part in parts), math.nan)


def _excess_far_off(survey: Survey) -> float:
    """Return how much higher unsupporting chips match together far off; NaN: they are few."""
    return math.nan if survey.far is None else survey.far.excess


def _without_drawn(evidence: RegistrationEvidence) -> Rest | None:
    """Return what remains without possibly drawn content; None: no such content."""
    rest = evidence.surveys.rest
    return None if rest is None or not rest.shared.is_evident else rest


def _of_survey(measure: Callable[[Survey], float]) -> Callable[[RegistrationEvidence], float]:
    def value(evidence: RegistrationEvidence) -> float:
        return math.nan if evidence.surveys.whole is None else measure(evidence.surveys.whole)

    return value


def _rest_height(evidence: RegistrationEvidence) -> float:
    rest = _without_drawn(evidence)
    left = None if rest is None else rest.survey
    if rest is None or left is None:
        return math.nan
    is_nothing = rest.shared.is_explained and has_few_chips(left, rest.chips)
    return math.nan if is_nothing else left.height


def _share_far_off(evidence: RegistrationEvidence) -> float:
    far = evidence.surveys.far
    return math.nan if far is None else far.height / max(far.own_height, 0.1)


def _stripes_in_place(evidence: RegistrationEvidence) -> float:
    """Return how well stripes that match elsewhere match in their place, as a share of that."""
    found = evidence.surveys.stripes
    if found is None or found.height < REST_PEAK_DEVIATIONS:
        return math.nan
    return found.own_height / found.height


def _ground_of_cameras(evidence: RegistrationEvidence) -> float:
    """Return the height of a second place, as high, without what is dark or bright."""
    surveys = evidence.surveys.ground
    if not surveys or evidence.scene.sensors is not Sensors.CAMERAS:
        return math.nan
    rivals = (one for one in surveys if one.rival_height >= RIVAL_HEIGHT * one.height)
    return max(map(deviations_elsewhere, rivals), default=0.0)


def _rest_peak(evidence: RegistrationEvidence) -> float:
    rest = _without_drawn(evidence)
    if rest is None or rest.survey is None or has_few_chips(rest.survey, rest.chips):
        return math.nan
    return deviations_elsewhere(rest.survey)


def _off_drawn(evidence: RegistrationEvidence) -> float:
    """Return how far the movement of two camera images is from that of drawn content."""
    rest = _without_drawn(evidence)
    if rest is None or rest.shared.sensors is not Sensors.CAMERAS:
        return math.nan
    return rest.shared.off_drawn


def _moved_ground(evidence: RegistrationEvidence) -> float:
    """Return the share of the rest that varies alike, of images that move as ground does."""
    rest, is_moved = _without_drawn(evidence), _off_drawn(evidence) > 1
    return rest.shared.sameness.ground if rest is not None and is_moved else math.nan


def _fine_coherence(evidence: RegistrationEvidence) -> float:
    """Return the coherence of fine structure if it exceeds that of coarse structure, else 0."""
    rest = evidence.surveys.rest
    if rest is None or rest.shared.sensors is not Sensors.RADARS:
        return math.nan
    same = rest.shared.sameness
    return same.fine_coherence if same.fine_coherence > same.coarse_coherence else 0.0


def _height_of_else(evidence: RegistrationEvidence) -> float:
    rest = evidence.surveys.rest
    height = height_of_else(rest)
    return height / rest.least if rest is not None and math.isfinite(height) else math.nan


def _brighter(evidence: RegistrationEvidence) -> float:
    """Return by how much what varies alike is brighter, where hardly anything else matches."""
    rest = evidence.surveys.rest
    if rest is None or rest.survey is None or not math.isfinite(height_of_else(rest)):
        return math.nan
    is_low = rest.survey.height < rest.least
    return rest.shared.sameness.brighter if is_low else math.nan


def _opposite_signs(evidence: RegistrationEvidence) -> float:
    """Return how many windows have opposite contrast for each that has the same; NaN: not asked."""
    signs = evidence.surveys.signs
    return math.nan if signs is None else signs.negative / max(signs.positive, LEAST_POSITIVE)


STATISTICS = (
    Statistic("part elsewhere: excess", LEAST_EXCESS, _of_survey(_excess)),
    Statistic("part elsewhere: excess far off", LEAST_EXCESS, _of_survey(_excess_far_off)),
    Statistic("stripes elsewhere: in their place", STRIPES_IN_PLACE, _stripes_in_place, False),
    Statistic(
        "second place: share of the height",
        RIVAL_HEIGHT,
        _of_survey(lambda s: s.rival_height / max(s.height, 0.1)),
    ),
    Statistic(
        "second place far off: share of the height",
        RIVAL_HEIGHT,
        _share_far_off,
    ),
    Statistic(
        "ground elsewhere: second place of cameras",
        EVEN_PEAK_DEVIATIONS,
        _ground_of_cameras,
    ),
    Statistic("second place: peak", PEAK_DEVIATIONS, _of_survey(deviations_elsewhere)),
    Statistic("weak similarity: height", WEAK_HEIGHT, _of_survey(lambda s: s.height), False),
    Statistic("pixel-locked content: height", WEAK_HEIGHT, _rest_height, False),
    Statistic("pixel-locked content: second peak", REST_PEAK_DEVIATIONS, _rest_peak),
    Statistic(
        "unexplained elsewhere: second peak",
        REST_PEAK_DEVIATIONS,
        lambda evidence: deviations_of_unexplained(evidence.surveys),
    ),
    Statistic("one sign of contrast: negative", MOST_NEGATIVE, _opposite_signs, False),
    Statistic("pixel-locked content: fine coherence", FINE_COHERENCE, _fine_coherence),
    Statistic("pixel-locked content: off what is drawn", 1.0, _off_drawn, False),
    Statistic("pixel-locked content: moved ground", MOVED_GROUND_SHARE, _moved_ground, False),
    Statistic("nothing else in common: height", 1.0, _height_of_else, False),
    Statistic("nothing else in common: brighter", LEAST_BRIGHTER, _brighter),
    Statistic(
        "rest elsewhere: second peak",
        REST_PEAK_DEVIATIONS,
        lambda evidence: deviations_of_rest(evidence.surveys.rest),
    ),
)


@dataclass(frozen=True)
class Margins:
    """The survey's statistics of one transform.

    Parameters
    ----------
    name
        The case.
    error_px, is_right
        Error of the transform, and whether it is right, whatever the verdict is.
    rules
        Names of all rules that refuse it, the deciding one first.
    values
        A value for each of `STATISTICS`; NaN: none.
    """

    name: str
    error_px: float
    is_right: bool
    rules: tuple[str, ...]
    values: tuple[float, ...]

    def record(self) -> dict[str, Any]:
        """Return the measurements as values that JSON can carry."""
        names = [statistic.name for statistic in STATISTICS]
        return plain(
            {
                "name": self.name,
                "error_px": self.error_px,
                "is_right": self.is_right,
                "rules": list(self.rules),
                **dict(zip(names, self.values, strict=True)),
            }
        )

    def line(self) -> str:
        """Return the measurements as a line of text."""
        kind = "right" if self.is_right else "wrong"
        values = ", ".join(f"{value:.1f}" for value in self.values)
        return f"{self.name}: {kind} ({self.error_px:.1f} px), {values}; {', '.join(self.rules)}"


@dataclass(frozen=True)
class AttackedPair:
    """A pair of the red team, possibly a control."""

    case: AttackCase

    def run(self, workers: int | None) -> Margins:
        """Register the pair and measure."""
        pair = self.case.make()
        try:
            spec = _SPECIFICATIONS[self.case.tool]
            found = found_by(spec, *pair.rasters(), **pair.arguments(), workers=workers)
        except GroundTieError as error:
            return Margins(self.case.name, math.inf, False, (str(error),), _NOTHING)
        error_px = math.inf if found.transform is None else pair.errors_px(found.transform)[0]
        return _measured(self.case.name, found, error_px, pair.sigma_px)


@dataclass(frozen=True)
class RealPair:
    """A whole real pair."""

    case: RealCase

    def run(self, workers: int | None) -> Margins:
        """Register the pair and measure."""
        with tempfile.TemporaryDirectory() as folder:
            shift = draw_shift(self.case, LARGEST_SHIFT_PX, 0)
            pair = write_case(self.case, shift, Path(folder))
            radius_m = search_radius_m(LARGEST_SHIFT_PX)
            found = found_by(COREGISTER, pair.reference, pair.input, radius_m, workers)
            error_px = math.inf
            if found.transform is not None and pair.truth is not None:
                error_px = pair.truth.error_px(on_pixels(found.transform, pair.reference))
            # Measured here, as rules may read the images, which vanish with the folder.
            return _measured(self.case.name, found, error_px, pair.sigma_px)


_NOTHING = (math.nan,) * len(STATISTICS)


def _measured(name: str, found: Registration, error_px: float, sigma_px: float) -> Margins:
    evidence = found.evidence
    values = _NOTHING if evidence is None else tuple(one.of(evidence) for one in STATISTICS)
    is_right = error_px <= SILENTLY_WRONG_PX + sigma_px
    # A search without a transform has no evidence about one; its verdict names its only rule.
    decided = (found.verdict.rule,) if found.verdict.rule else ()
    rules = decided if evidence is None else tuple(rule.name for rule, _ in refusals(evidence))
    return Margins(name, error_px, is_right, rules, values)


def run(settings: Settings) -> SuiteResult:
    """Run on `--sample` attacks of `--classes` and on real pairs, or on a `--case` alone."""
    wanted = _QUICK if settings.quick else settings.sample or _SAMPLE
    attacks = choose(replace(settings, quick=False, sample=wanted), _SPECIFICATIONS)
    chosen = [AttackedPair(case) for case in attacks]
    is_all = not (settings.quick or settings.named)
    real = [RealPair(case) for case in read_cases(settings.data)] if is_all else []
    found: list[Margins] = list(run_cases([*real, *chosen], settings.jobs))
    return SuiteResult(
        "Margins: what right and wrong transforms leave to the limits of rules",
        (),
        (
            *(_table(number, statistic, found) for number, statistic in enumerate(STATISTICS)),
            rules_table(found),
        ),
        [one.record() for one in found],
        (
            "Right and wrong are transforms, whatever the verdict on them is: other rules may "
            "refuse what is wrong. Alone: no other rule refuses the same transform.",
        ),
    )


def _table(number: int, statistic: Statistic, found: Sequence[Margins]) -> Table:
    """Return the distribution of a statistic among right and wrong transforms."""
    rows = []
    for kind, is_right in (("right", True), ("wrong", False)):
        of_kind = [one for one in found if one.is_right is is_right]
        values = np.array([one.values[number] for one in of_kind])
        values = values[np.isfinite(values)]
        beyond = values >= statistic.limit
        refused = beyond if statistic.is_refused_above else ~beyond
        cells = [f"{np.percentile(values, p):.2f}" for p in _PERCENT] if len(values) else ["–"] * 5
        rows.append([kind, str(len(values)), *cells, str(int(refused.sum()))])
    head = ("", "transforms", *(f"{p} %" for p in _PERCENT), f"refused at {statistic.limit:g}")
    return Table(statistic.name, head, rows)


def rules_table(found: Sequence[Margins]) -> Table:
    """Return how often each rule refuses wrong and right transforms, and how often alone.

    A rule that never refuses a wrong transform alone can be removed without letting any pass.
    """
    rows = []
    for name in sorted({rule for one in found for rule in one.rules}):
        cells = []
        for is_right in (False, True):
            refused = [one for one in found if one.is_right is is_right and name in one.rules]
            cells += [str(len(refused)), str(sum(one.rules == (name,) for one in refused))]
        rows.append([name, *cells])
    return Table("By rule", ("rule", "wrong", "alone", "right", "alone"), rows)
