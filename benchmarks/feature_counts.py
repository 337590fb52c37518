"""Detectors, descriptors and ways of matching on registered pairs of radar images."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundtie.features.keypoints import Keypoints
from groundtie.features.matching import GATE_PX, match_near
from groundtie.features.tiles import Detecting
from groundtie.geometry.models import Model
from groundtie.geometry.robust import distances, find_consensus, fit_robustly
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster
from groundtie.studies.evaluation import Variant, evaluate
from groundtie.studies.matching import match
from groundtie.studies.repeatability import CLASS_NAMES
from groundtie.studies.sift_variants import DETECTORS, SiftVariantDescriptor, sift_detector

from .cases import RealCase, write_case
from .suites import Goal, Table

# Matching by descriptors alone, and in the gate: [Suri2010] table 6.11.
RATIO = 0.8
_HYBRID_CONTRAST = 0.03

# A match is right within this distance of the truth, or within the truth's sigma if larger.
_RIGHT_PX = 2.0

# Error of the gate's prediction, as large as that of a rough shift.
_OFF_PX = np.array([1.5, -1.5])

# RANSAC keeps matches within this distance of the model; wrong ones fall there by chance.
_RANSAC_PX = 3.0

# Number of runs of each detector's whole chain; the shortest time counts.
_REPEATS = 3

_WANTED_SHARE = 0.25
_WANTED_SPEED = 4.0
_WANTED_GAIN = 5.0
_WANTED_KEPT = 0.8


@dataclass(frozen=True)
class DetectorCount:
    """A detector's results on a pair; `right` counts right matches at the ratio of 0.8."""

    name: str
    detector: str
    detections: tuple[int, int]
    repeated: tuple[float, ...]
    matches: int
    filtered: int
    right: int
    right_filtered: int
    seconds: float


@dataclass(frozen=True)
class ChainCount:
    """Right matches, and all matches kept, of three ways to match.

    `standard` is plain, oriented SIFT at the ratio with RANSAC. `alone` is upright SIFT-OCT at the
    same ratio with RANSAC. `hybrid` matches in the gate of a rough shift; `by_chance` of its right
    matches are expected to be right by chance.
    """

    name: str
    standard: tuple[int, int]
    alone: tuple[int, int]
    hybrid: tuple[int, int]
    by_chance: float


@dataclass(frozen=True)
class TurnCount:
    """Right matches without and after a quarter turn, at the ratio of 0.8."""

    name: str
    gradient: str
    without: int
    turned: int


_Described = tuple[Keypoints, NDArray[np.float32]]


def registered(case: RealCase) -> tuple[Patch, Patch]:
    """Return a pair of images, the input resampled onto the reference by the truth."""
    with tempfile.TemporaryDirectory() as folder:
        files = write_case(case, (0.0, 0.0), Path(folder))
        with open_raster(files.reference) as reference, open_raster(files.input) as input:
            pair: ImagePair = make_pair(Image(reference), Image(input), None, 0.0)
            grid = pair.grid
            return pair.reference_patch(grid), pair.input_patch(grid, pair.nominal_px)


def _right(first: Keypoints, second: Keypoints, limit_px: float) -> np.ndarray:
    return np.hypot(*(second.position_px - first.position_px).T) <= limit_px


def count_detector(case: RealCase, detector: str) -> DetectorCount:
    """Count the results of an upright detector with its own contrast on a registered pair."""
    reference, input = registered(case)
    variant = Variant.parse(detector)
    runs = [evaluate(variant, reference, input, RATIO, "kd-tree") for _ in range(_REPEATS)]
    fastest = min(runs, key=lambda run: run.detecting_s + run.matching_s)
    # Up to 20 % of overlap error is right: at most six pixels, for large features.
    return DetectorCount(
        case.name,
        detector,
        fastest.detections,
        tuple(fastest.repeated.tolist()),
        fastest.matched.matches,
        fastest.filtered.matches,
        int(fastest.matched.by_class[:2].sum()),
        int(fastest.filtered.by_class[:2].sum()),
        fastest.detecting_s + fastest.matching_s,
    )


def count_chain(case: RealCase) -> ChainCount:
    """Count right matches by descriptors alone with RANSAC, and in the gate of a rough shift."""
    reference, input = registered(case)
    limit = max(case.sigma_px, _RIGHT_PX)

    def described(detector: Detecting, upright: bool) -> tuple[_Described, _Described]:
        descriptor = SiftVariantDescriptor(upright=upright)
        first, second = (descriptor.describe(p, detector.detect(p)) for p in (reference, input))
        return first, second

    def by_ransac(first: _Described, second: _Described) -> tuple[int, int]:
        found = match(first[1], second[1], RATIO)
        one, other = first[0].take(found.first), second[0].take(found.second)
        model = find_consensus(one.position_px, other.position_px, _RANSAC_PX)
        return _counts(one, other, model, limit)

    first, second = described(sift_detector("sift-oct", _HYBRID_CONTRAST), True)
    near = match_near(first[1], second[1], first[0].position_px + _OFF_PX, second[0].position_px)
    one, other = first[0].take(near.first), second[0].take(near.second)
    px = one.position_px, other.position_px
    start = find_consensus(*px, _RANSAC_PX, "similarity")
    area = float(np.pi * GATE_PX**2)
    model, _ = fit_robustly("affine", *px, 0.0, start, area)
    hybrid = _counts(one, other, model, limit)
    return ChainCount(
        case.name,
        by_ransac(*described(sift_detector("sift"), False)),
        by_ransac(first, second),
        hybrid,
        (len(near) - hybrid[0]) * (min(limit, _RANSAC_PX) / GATE_PX) ** 2,
    )


def _counts(first: Keypoints, second: Keypoints, model: Model, limit_px: float) -> tuple[int, int]:
    """Return the numbers of right matches and of all matches that agree with a model."""
    kept = distances(model, first.position_px, second.position_px) <= _RANSAC_PX
    return int((_right(first, second, limit_px) & kept).sum()), int(kept.sum())


def count_turn(case: RealCase, gradient: str) -> TurnCount:
    """Count right matches of oriented descriptors before and after a quarter turn of the input."""
    reference, input = registered(case)
    detector, descriptor = sift_detector("sift-oct"), SiftVariantDescriptor(gradient, upright=False)
    points, rows = descriptor.describe(reference, detector.detect(reference))
    found = []
    for turns in (0, 1):
        turned = Patch(*(np.rot90(part, turns).copy() for part in (input.values, input.valid)))
        partners, partner_rows = descriptor.describe(turned, detector.detect(turned))
        matches = match(rows, partner_rows, RATIO)
        second = partners.take(matches.second)
        if turns:
            col, row = second.position_px.T
            back = np.column_stack([input.values.shape[1] - 1 - row, col])
            second = replace(second, position_px=back)
        right = _right(points.take(matches.first), second, max(case.sigma_px, _RIGHT_PX))
        found.append(int(right.sum()))
    return TurnCount(case.name, gradient, *found)


def detector_table(counts: Sequence[DetectorCount]) -> Table:
    """Return the results of the detectors, as [Suri2010] tables 6.5 to 6.8."""
    head = ("pair", "detector", "features", *(f"repeat {c}" for c in CLASS_NAMES[:2]))
    rows = [
        [
            one.name,
            one.detector,
            f"{one.detections[0]} / {one.detections[1]}",
            *(f"{100 * score:.0f} %" for score in one.repeated[:2]),
            f"{one.right} of {one.matches}",
            f"{one.right_filtered} of {one.filtered}",
            f"{one.seconds:.2f}",
        ]
        for one in counts
    ]
    return Table("Detectors", (*head, "right matches", "after filtering", "s"), rows)


def chain_table(counts: Sequence[ChainCount]) -> Table:
    """Return the right matches of all ways to match, as [Suri2010] table 6.11."""
    rows = [
        [
            one.name,
            *(f"{right} of {kept}" for right, kept in (one.standard, one.alone, one.hybrid)),
            f"{one.by_chance:.0f}",
        ]
        for one in counts
    ]
    ways = (f"SIFT, {RATIO:g}, RANSAC", f"upright SIFT-OCT, {RATIO:g}, RANSAC", "hybrid")
    title = "Right matches of those that are left"
    return Table(title, ("pair", *ways, "of these expected by chance"), rows)


def turn_table(counts: Sequence[TurnCount]) -> Table:
    """Return right matches before and after a quarter turn, as [Suri2010] table 6.2."""
    rows = [
        [one.name, one.gradient, str(one.without), str(one.turned), _share(one.turned, one.without)]
        for one in counts
    ]
    head = ("pair", "gradient", "not turned", "turned by 90°", "kept")
    return Table("Right matches of oriented descriptors", head, rows)


def _share(part: int, whole: int) -> str:
    return f"{part / max(whole, 1):.0%}"


def goals(
    detectors: Sequence[DetectorCount], chains: Sequence[ChainCount], turns: Sequence[TurnCount]
) -> tuple[Goal, ...]:
    """Return the goals of the claims of [Suri2010], with their results."""
    by = {name: [one for one in detectors if one.detector == name] for name in DETECTORS}
    features = {name: sum(map(sum, (o.detections for o in own))) for name, own in by.items()}
    seconds = {name: sum(one.seconds for one in own) for name, own in by.items()}
    right = {name: [one.right for one in own] for name, own in by.items()}
    fewer = [
        f"{one.name} {b} < {a}"
        for one, a, b in zip(by["sift"], right["sift"], right["sift-oct"], strict=True)
        if b < a
    ]
    hardest = min(chains, key=lambda one: one.standard[0])
    gain = hardest.hybrid[0] / max(hardest.standard[0], 1)
    kept = {
        gradient: sum(t.turned for t in turns if t.gradient == gradient)
        / max(sum(t.without for t in turns if t.gradient == gradient), 1)
        for gradient in dict.fromkeys(t.gradient for t in turns)
    }
    share = features["sift-oct"] / max(features["sift"], 1)
    speed = seconds["sift"] / max(seconds["sift-oct"], 1e-9)
    return (
        Goal(
            "SIFT-OCT: features, of SIFT's",
            f"at most {_WANTED_SHARE:.0%}",
            f"{share:.0%}",
            share <= _WANTED_SHARE,
        ),
        Goal(
            "SIFT-OCT: right matches",
            "no fewer than SIFT's on any pair",
            f"{sum(right['sift-oct'])} against {sum(right['sift'])}"
            + (f"; fewer: {', '.join(fewer)}" if fewer else ""),
            not fewer,
        ),
        Goal(
            "SIFT-OCT: time, SIFT's over it",
            f"at least {_WANTED_SPEED:g}",
            f"{speed:.1f}",
            speed >= _WANTED_SPEED,
        ),
        Goal(
            f"Hybrid on the hardest pair ({hardest.name}): right matches over those of "
            f"SIFT at ratio {RATIO:g} with RANSAC",
            f"at least {_WANTED_GAIN:g}",
            f"{gain:.1f} ({hardest.standard[0]} → {hardest.hybrid[0]})",
            gain >= _WANTED_GAIN,
        ),
        Goal(
            "Signed ROEWA: right matches kept under 90°",
            f"at least {_WANTED_KEPT:.0%}",
            f"{kept['roewa']:.0%}",
            kept["roewa"] >= _WANTED_KEPT,
        ),
        Goal(
            "Unsigned ROEWA: the same",
            "reported: less than half",
            f"{kept['roewa-unsigned']:.0%}",
            None,
        ),
    )


def records(parts: Sequence[object]) -> list[dict[str, object]]:
    """Return counts as values that JSON can carry."""
    return [asdict(part) for part in parts]  # type: ignore[call-overload]
