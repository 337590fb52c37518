"""Peaks of mutual information on real SAR–optical pairs: bins, masks, and peak searches.

Inputs are warped by the truth, so that only a shift is unknown.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from groundtie.context import threads
from groundtie.geometry.limits import SearchLimits
from groundtie.rasters.patch import Patch
from groundtie.similarity.binning import MASKED, to_bins
from groundtie.similarity.joint_histogram import (
    count_joint_histograms,
    gpve_histograms,
    reach,
)
from groundtie.similarity.measures import normalized_mutual_information
from groundtie.similarity.surface import SimilaritySettings, detrend
from groundtie.studies.climbing import ClimbingSearch
from groundtie.studies.simplex import nelder_mead, powell
from groundtie.studies.spsa import discrete_spsa, spsa, spsa_second_order

from .accuracy import CORRECT_PX
from .cases import SAR_OPTICAL, RealCase, read_cases, read_image
from .suites import Goal, Settings, SuiteResult, Table

Surface = NDArray[np.float32]
Peak = tuple[int, int]

RADIUS_PX = 20

# [Suri2010] table 3.2, without its 256th bin: bins are bytes, and one value marks masked pixels.
BINS_RADIUS_PX = 10
BIN_COUNTS = (8, 16, 32, 64, 128, 255)
WANTED_BINS = 32
BINNINGS = ("linear", "equal-frequency")
NEAREST = 1
ORDERS = (NEAREST, 4, 7)

# [Suri2010] table 4.2.
SHARES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
WANTED_SHARE = 0.7
_MASK_BINS = 32
_BLOCK_PX = 4

# [Suri2010] table 4.3, with many seeds instead of four.
RUNS = 100
CONTINUOUS_RUNS = 3
WANTED_REACHED = 0.9
_SAME_PX = 1.0
_OFF_CENTRE_PX = 10
CLIMBED = SimilaritySettings("nmi")

# Counting of all shifts of a large window.
WINDOW_PX, WINDOW_RADIUS_PX, WINDOW_BINS = 1000, 100, 16
_WANTED_RATIO = 3.0

SEARCHES: dict[str, ClimbingSearch] = {
    "discrete SPSA": discrete_spsa,
    "SPSA": spsa,
    "second-order SPSA": spsa_second_order,
    "Powell": powell,
    "Nelder–Mead": nelder_mead,
}
DISCRETE = next(iter(SEARCHES))


@dataclass(frozen=True)
class Aligned:
    """A reference and an input warped onto its pixels by the truth."""

    name: str
    sigma_px: float
    reference: Patch
    input: Patch

    def windows(self, centre: Peak, radius_px: int) -> tuple[Patch, Patch]:
        """Return the same template for every centre, and the displaced input around it.

        The input's content lies -centre (right, down) from where the template expects it.
        """
        margin = 2 * RADIUS_PX
        height, width = (size - 2 * margin for size in self.reference.values.shape)
        template = _cut(self.reference, margin, margin, height, width)
        col, row = (margin + c - radius_px for c in centre)
        return template, _cut(self.input, row, col, height + 2 * radius_px, width + 2 * radius_px)


def _cut(patch: Patch, row: int, col: int, height: int, width: int) -> Patch:
    inside = slice(row, row + height), slice(col, col + width)
    return Patch(
        np.ascontiguousarray(patch.values[inside]), np.ascontiguousarray(patch.valid[inside])
    )


def align(case: RealCase) -> Aligned:
    """Read a case and warp its input by the truth; bands are averaged."""
    reference, input = (
        read_image(path).mean(axis=0, dtype=np.float32) for path in (case.reference, case.input)
    )
    warp = partial(cv2.warpAffine, M=case.matrix, dsize=reference.shape[::-1])
    values = warp(input, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    seen = warp(np.ones_like(input), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP) > 0
    return Aligned(
        case.name,
        case.sigma_px,
        Patch(reference, np.ones(reference.shape, bool)),
        Patch(values, seen),
    )


def nmi_surfaces(
    template: NDArray[np.uint8], search: NDArray[np.uint8], bins: int, orders: Sequence[int]
) -> list[Surface]:
    """Return the NMI over shifts for several kernel orders; 1 is nearest neighbour.

    `search` exceeds `template` by the radius and the widest kernel's reach on each side.
    """
    counts = count_joint_histograms(template, search, (bins, bins))
    surfaces = []
    for order in orders:
        further = max(reach(other) for other in ORDERS) - reach(order)
        inner = slice(further, -further or None)
        near = counts[inner, inner]
        histograms = near if order == NEAREST else gpve_histograms(near, order)
        # Row by row, because the logarithms of all histograms at once would need much memory.
        rows = [normalized_mutual_information(row) for row in histograms]
        surfaces.append(np.stack(rows).astype(np.float32))
    return surfaces


def peak_of(surface: Surface) -> Peak:
    """Return the shift (right, down) of the highest value."""
    row, col = np.unravel_index(surface.argmax(), surface.shape)
    return int(col) - surface.shape[1] // 2, int(row) - surface.shape[0] // 2


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    cases = [case for case in read_cases(settings.data) if case.kind == SAR_OPTICAL]
    pairs = [align(case) for case in (cases[1:3] if settings.quick else cases)]
    bins, masks, climbs = (
        [record for pair in pairs for record in _told(measure(pair))]
        for measure in (measure_bins, measure_masks, partial(measure_climbs, quick=settings.quick))
    )
    counting = time_counting(300 if settings.quick else WINDOW_PX)
    return SuiteResult(
        "Peaks of mutual information, SAR–optical",
        (bins_goal(bins), *masks_goals(masks), *climbs_goals(climbs), counting_goal(counting)),
        (bins_table(bins), masks_table(masks), climbs_table(climbs)),
        [*bins, *masks, *climbs, counting],
        (
            f"Peaks are the highest of all whole shifts (right, down) of ± {BINS_RADIUS_PX} px for "
            f"bins and ± {RADIUS_PX} px for masks, as in [Suri2010] tables 3.2 and 4.2; "
            "(0, 0) is the truth, which is known to σ. Climbs: one window a pair, whose centre is "
            f"up to {_OFF_CENTRE_PX} px off the truth, seeds drawn evenly from ± {RADIUS_PX} px. "
            "They must reach the peak of the exhaustive search in that window, exactly if "
            f"discrete, else within {_SAME_PX:g} px. Evaluations are those of the whole search, "
            "restarts included. The gains and the number of agreeing climbs were chosen on these "
            "pairs.",
        ),
    )


def _told(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    for record in records[:1]:
        print(f"{record['what']}: {record['pair']}", flush=True)
    return records


# Bins: [Suri2010] table 3.2.


def measure_bins(pair: Aligned) -> list[dict[str, Any]]:
    """Return the peaks of one pair for all numbers of bins, binnings and kernels."""
    margin = BINS_RADIUS_PX + max(reach(order) for order in ORDERS)
    records = []
    for binning in BINNINGS:
        for count in BIN_COUNTS:
            template, search = (
                to_bins(patch.values, patch.valid, count, binning)
                for patch in (pair.reference, pair.input)
            )
            inner = np.ascontiguousarray(template[margin:-margin, margin:-margin])
            surfaces = nmi_surfaces(inner, search, count, ORDERS)
            for order, surface in zip(ORDERS, surfaces, strict=True):
                peak = peak_of(surface)
                records.append(
                    {
                        "what": "bins",
                        "pair": pair.name,
                        "sigma_px": pair.sigma_px,
                        "binning": binning,
                        "bins": count,
                        "order": order,
                        "peak": peak,
                        "is_true": is_true(peak, pair.sigma_px),
                    }
                )
    return records


def is_true(peak: Peak, sigma_px: float) -> bool:
    """Return whether a peak lies within `CORRECT_PX` plus the truth's uncertainty of the truth."""
    return float(np.hypot(*peak)) <= sigma_px + CORRECT_PX


def bins_goal(records: Sequence[dict[str, Any]]) -> Goal:
    """Return the goal for numbers of bins, with its result."""
    wanted = [record for record in records if record["bins"] >= WANTED_BINS]
    found = sum(record["is_true"] for record in wanted)
    return Goal(
        f"Highest of NMI is the true peak, {WANTED_BINS} to {BIN_COUNTS[-1]} bins",
        f"all, within σ + {CORRECT_PX:g} px",
        f"{found} of {len(wanted)}",
        found == len(wanted),
    )


def bins_table(records: Sequence[dict[str, Any]]) -> Table:
    """Return the number of pairs whose peak lies at the truth."""
    rows = []
    for binning in BINNINGS:
        for count in BIN_COUNTS:
            cells = []
            for order in ORDERS:
                group = [
                    r
                    for r in records
                    if (r["binning"], r["bins"], r["order"]) == (binning, count, order)
                ]
                distance = np.median([np.hypot(*record["peak"]) for record in group])
                found = sum(record["is_true"] for record in group)
                cells.append(f"{found} of {len(group)}, {distance:.1f} px")
            rows.append([f"{binning}, {count}", *cells])
    head = ("bins", "nearest neighbour", "cubic (order 4)", "order 7")
    return Table("True peaks, and median distance to the truth, by bins", head, rows)


# Masks: [Suri2010] table 4.2.


def block_mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean of every block at each of its pixels ([Suri2010] 4.5)."""
    height, width = values.shape
    small = cv2.copyMakeBorder(
        values, 0, -height % _BLOCK_PX, 0, -width % _BLOCK_PX, cv2.BORDER_REPLICATE
    )
    size = small.shape[1] // _BLOCK_PX, small.shape[0] // _BLOCK_PX
    small = cv2.resize(small, size, interpolation=cv2.INTER_AREA)
    return np.kron(small, np.ones((_BLOCK_PX, _BLOCK_PX), np.float32))[:height, :width]


def measure_masks(pair: Aligned) -> list[dict[str, Any]]:
    """Return the peaks of one pair with the SAR image's brightest pixels or blocks masked."""
    values = pair.reference.values
    margin = RADIUS_PX + max(reach(order) for order in ORDERS)
    own, other = (
        to_bins(patch.values, patch.valid, _MASK_BINS) for patch in (pair.reference, pair.input)
    )
    records = []
    for by, level in (("pixels", values), ("blocks", block_mean(values))):
        unmasked: dict[str, Peak] = {}
        for share in (0.0, *SHARES):
            masked = np.where(level > np.quantile(level, 1 - share), MASKED, own)
            inner = np.ascontiguousarray(masked[margin:-margin, margin:-margin])
            nearest, cubic = nmi_surfaces(inner, other, _MASK_BINS, (NEAREST, 4))
            surfaces = {"nearest": nearest, "cubic": cubic, "without trend": detrend(cubic)}
            for surface, values_of in surfaces.items():
                peak = peak_of(values_of)
                start = unmasked.setdefault(surface, peak)
                records.append(
                    {
                        "what": "masks",
                        "pair": pair.name,
                        "sigma_px": pair.sigma_px,
                        "by": by,
                        "surface": surface,
                        "share": share,
                        "peak": peak,
                        "moved_px": max(abs(a - b) for a, b in zip(peak, start, strict=True)),
                        "is_true": is_true(peak, pair.sigma_px),
                    }
                )
    return records


def masks_goals(records: Sequence[dict[str, Any]]) -> list[Goal]:
    """Return the goals for masks, by masked unit and surface."""
    goals = []
    for by in ("pixels", "blocks"):
        for surface in ("cubic", "without trend"):
            held, steady, names = _steady(records, by, surface)
            goals.append(
                Goal(
                    f"Peak with up to {WANTED_SHARE:.0%} masked, brightest {by}, {surface}",
                    "all pairs within 1 px of the unmasked peak",
                    f"{len(steady)} of {len(names)} pairs; {held} of single masks",
                    len(steady) == len(names),
                )
            )
    return goals


def _steady(
    records: Sequence[dict[str, Any]], by: str, surface: str
) -> tuple[str, list[str], list[str]]:
    """Return how many masks keep the peak, the pairs where all of them do, and all pairs."""
    group = [
        r
        for r in records
        if r["by"] == by and r["surface"] == surface and 0 < r["share"] <= WANTED_SHARE
    ]
    names = list(dict.fromkeys(record["pair"] for record in group))
    moved = {name: [r["moved_px"] for r in group if r["pair"] == name] for name in names}
    held = sum(record["moved_px"] <= 1 for record in group)
    return f"{held} of {len(group)}", [n for n in names if max(moved[n]) <= 1], names


def masks_table(records: Sequence[dict[str, Any]]) -> Table:
    """Return the peaks of all pairs on the cubic surface with bright blocks masked."""
    shares = (0.0, *SHARES)
    rows = []
    for by in ("pixels", "blocks"):
        for name in dict.fromkeys(record["pair"] for record in records):
            peaks = {
                r["share"]: r["peak"]
                for r in records
                if (r["pair"], r["by"], r["surface"]) == (name, by, "cubic")
            }
            rows.append([name, by, *("({}, {})".format(*peaks[share]) for share in shares)])
    head = ("pair", "masked", *(f"{share:.0%}" for share in shares))
    return Table("Peaks with the brightest part of the SAR masked, cubic kernel", head, rows)


# Climbs: [Suri2010] table 4.3.


def measure_climbs(pair: Aligned, quick: bool) -> list[dict[str, Any]]:
    """Return how often every search reaches the peak of one pair, and its cost."""
    rng = np.random.default_rng(zlib.crc32(pair.name.encode()))
    right, down = map(int, rng.integers(-_OFF_CENTRE_PX, _OFF_CENTRE_PX + 1, 2))
    windows = pair.windows((right, down), RADIUS_PX)
    peak = exhaustive_peak(*windows)
    records = []
    for name, search in SEARCHES.items():
        discrete = name == DISCRETE
        runs = RUNS if discrete and not quick else CONTINUOUS_RUNS
        reached, evaluations, seconds = [], [], []
        for number in range(runs):
            # The seed draws where the search starts.
            with threads(1, seed=number) as context:
                started = time.perf_counter()
                found = search(*windows, SearchLimits(RADIUS_PX), CLIMBED, context)[0]
                seconds.append(time.perf_counter() - started)
            distance_px = np.abs(np.subtract(found.pose.shift_px, peak)).max()
            reached.append(bool(distance_px <= (0 if discrete else _SAME_PX)))
            evaluations.append(found.evaluations)
        records.append(
            {
                "what": "climbs",
                "pair": pair.name,
                "search": name,
                "runs": len(reached),
                "reached": sum(reached),
                "evaluations": float(np.mean(evaluations)),
                "seconds": float(np.median(seconds)),
            }
        )
    return records


def exhaustive_peak(template: Patch, input: Patch) -> Peak:
    """Return the shift with the highest NMI at aligned grids."""
    bins = CLIMBED.bins_for(template.values.size)
    own, other = (to_bins(patch.values, patch.valid, bins) for patch in (template, input))
    counts = count_joint_histograms(own, other, (bins, bins))
    return peak_of(np.stack([normalized_mutual_information(row) for row in counts]))


def climbs_goals(records: Sequence[dict[str, Any]]) -> list[Goal]:
    """Return the goals for all searches; only the discrete SPSA has a wanted value."""
    goals = []
    for name in SEARCHES:
        group = [record for record in records if record["search"] == name]
        shares = [record["reached"] / record["runs"] for record in group]
        evaluations = np.mean([record["evaluations"] for record in group])
        worst = f"worst pair {min(shares):.0%}"
        found = f"{np.mean(shares):.0%} ({worst}), {evaluations:.0f} evaluations"
        wanted, reached = "reported", None
        if name == DISCRETE:
            wanted = f"at least {WANTED_REACHED:.0%} of {RUNS} runs a pair"
            reached = min(shares) >= WANTED_REACHED
        goals.append(Goal(f"Exhaustive peak reached by {name}", wanted, found, reached))
    return goals


def climbs_table(records: Sequence[dict[str, Any]]) -> Table:
    """Return for all pairs and searches how often the peak was reached, and at what cost."""
    rows = []
    for name in dict.fromkeys(record["pair"] for record in records):
        group = {r["search"]: r for r in records if r["pair"] == name}
        cells = [
            f"{r['reached']} of {r['runs']}, {r['evaluations']:.0f}, {r['seconds']:.2f} s"
            for r in (group[search] for search in SEARCHES)
        ]
        rows.append([name, *cells])
    title = "Runs that reached the exhaustive peak; evaluations; time"
    return Table(title, ("pair", *SEARCHES), rows)


# Counting.


def time_counting(size: int) -> dict[str, Any]:
    """Time the counting of a large window's shifts, by FFT and one by one, on one thread."""
    rng = np.random.default_rng(0)
    span = 2 * WINDOW_RADIUS_PX + 1
    template, search = (
        rng.integers(0, WINDOW_BINS, (side, side)).astype(np.uint8)
        for side in (size, size + span - 1)
    )
    started = time.perf_counter()
    counts = count_joint_histograms(template, search, (WINDOW_BINS,) * 2)
    chosen = time.perf_counter()
    ranges = [0, WINDOW_BINS] * 2
    same = True
    for row, col in np.ndindex(span, span):
        window = search[row : row + size, col : col + size]
        counted = cv2.calcHist([template, window], [0, 1], None, [WINDOW_BINS] * 2, ranges)
        same &= bool(np.array_equal(counted, counts[row, col]))
    direct = time.perf_counter()
    return {
        "what": "counting",
        "size_px": size,
        "seconds": chosen - started,
        "direct_seconds": direct - chosen,
        "same": same,
    }


def counting_goal(record: dict[str, Any]) -> Goal:
    """Return the goal for counting by FFT, with its result."""
    ratio = record["direct_seconds"] / record["seconds"]
    size = record["size_px"]
    equal = "same counts" if record["same"] else "other counts"
    return Goal(
        f"Volume of {size}×{size} px, ± {WINDOW_RADIUS_PX} px, {WINDOW_BINS} bins",
        f"at least {_WANTED_RATIO:g} times faster than shift by shift",
        f"{ratio:.1f} times ({record['seconds']:.2f} s against {record['direct_seconds']:.2f} s), "
        + equal,
        record["same"] and ratio >= _WANTED_RATIO if size == WINDOW_PX else None,
    )
