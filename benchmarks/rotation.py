"""Phase correlation, Fourier–Mellin, Radon: known poses of 20 images, tables of [Patel2017]."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.context import threads
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.fourier_mellin import fourier_mellin
from groundtie.studies.phase_correlation import phase_correlation
from groundtie.studies.pose_searches import PoseSearch
from groundtie.studies.radon import radon

from .cases import read_image
from .injected import BLACK, MASKED, WHOLE, Image, Injection, pose_errors, unit_range
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table
from .thesis_radon import ACTUAL, ESTIMATES, SIZES, Estimates

REAL = (
    "oo-nanjing/nanjing1.jpg",
    "oo-lakes/e1.jpg",
    "oo-rotated/pair20_1.jpg",
    "so-airport/t1.tif",
    "so-airport/t2.tif",
    "so-fields/SAR1_sen.tif",
    "so-fields/visible1_ref.tif",
    "so-rosenheim/SAR2_sen.tif",
    "so-rosenheim/visible2_ref.tif",
    "so-forest-river/SO3a.png",
    "so-forest-river/SO3b.png",
    "so-dense-urban/SAR_sen.png",
)
SIMULATED = tuple(Simulation(1000, density, s) for density in ("rural", "suburban") for s in (1, 2))
_QUICK_IMAGES = 3

# P's images are not available: these are cropped to their sizes, the third only to its shape.
STAND_INS = {
    "image-1": ("oo-lakes/e1.jpg", (489, 300)),
    "image-2": ("oo-nanjing/nanjing1.jpg", (579, 481)),
    "image-3": ("so-airport/t1.tif", (640, 480)),
    "image-4": ("oo-rotated/pair20_1.jpg", (256, 256)),
}

PHASE, MELLIN, RADON = "phase correlation", "Fourier–Mellin", "Radon"
METHODS: dict[str, PoseSearch] = {PHASE: phase_correlation, MELLIN: fourier_mellin, RADON: radon}
SIMILARITIES = ("fused", "ncc")
NOISE_VARIANCES = (0.0, 0.001, 0.005)

LONGEST_SIDE_PX = 512
LARGEST_SHIFT_PX = 20.0
_RADIUS_PX = 40.0

# Largest wanted median errors.
_ROTATION_DEG = {PHASE: 0.1, MELLIN: 0.1, RADON: 0.25}
_ERROR_PX = 0.5


@dataclass(frozen=True)
class Range:
    """Ranges from which rotation and scale are drawn, and the methods that are tested."""

    name: str
    rotation_deg: float
    scale: tuple[float, float]
    methods: tuple[str, ...]

    def draw(self, seed: int) -> Pose:
        """Return a pose with a shift within ± `LARGEST_SHIFT_PX`."""
        random = np.random.default_rng(seed)
        turned = random.uniform(-self.rotation_deg, self.rotation_deg)
        scale = float(np.exp(random.uniform(*np.log(self.scale))))
        right, down = random.uniform(-LARGEST_SHIFT_PX, LARGEST_SHIFT_PX, 2)
        return Pose(turned, scale, (float(right), float(down)))

    @property
    def limits(self) -> SearchLimits:
        """Limits of the search."""
        return SearchLimits(_RADIUS_PX * max(self.scale[1], 1), self.rotation_deg, self.scale)


SHIFTS = Range("shifts", 0.0, (1.0, 1.0), (PHASE,))
SMALL = Range("± 30°", 30.0, (1.0, 1.0), (MELLIN, RADON))
LARGE = Range("± 180°, scale 0.5–2", 180.0, (0.5, 2.0), (MELLIN,))
RANGES = (SHIFTS, SMALL, LARGE)


@dataclass(frozen=True)
class Found:
    """The outcome of one search.

    Parameters
    ----------
    image, range, method, similarity, corners, noise_variance
        Image, range, method and further parameters of the search.
    rotation_deg, scale
        The truth.
    rotation_error_deg, error_px
        Errors of the best candidate; `error_px` is the root mean square over the reference.
    shift_errors_px
        Errors of the shift (x, y) of the input's centre.
    height
        Height of the best candidate.
    seconds
        Wall-clock time.
    """

    image: str
    range: str
    method: str
    similarity: str
    corners: str
    noise_variance: float
    rotation_deg: float
    scale: float
    rotation_error_deg: float
    error_px: float
    shift_errors_px: tuple[float, float]
    height: float
    seconds: float


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    found = search_all(settings)
    thesis = search_as_thesis(settings)
    return SuiteResult(
        "Rotation, scale and shift by spectra and projections",
        goals(found, enough=not settings.quick),
        (errors_table(found), thesis_table(thesis)),
        [asdict(one) for one in (*found, *thesis)],
        (
            f"Poses put into {len(REAL)} real and {2 * len(SIMULATED)} simulated images (SAR and "
            f"optical), windows of up to {LONGEST_SIDE_PX} px, shifts of up to "
            f"± {LARGEST_SHIFT_PX:g} px; the input shows the same extent of ground. Goals are "
            "judged by default similarity, without noise. Errors in pixels are root mean squares "
            "over the reference.",
            "[Patel2017]: its images are not to be had; ours are cut to their size, image-3 to "
            f"{STAND_INS['image-3'][1][0]}×{STAND_INS['image-3'][1][1]} px. P's times are those of "
            "MATLAB on a 2 GHz Pentium. Corners are black as P has them; here they are masked.",
        ),
    )


def read_images(settings: Settings) -> dict[str, Image]:
    """Return the images by their names, grey values 0 to 1."""
    paths: dict[str, Path] = {name: settings.data / name for name in REAL}
    if settings.quick:
        return {n: unit_range(read_image(p)) for n, p in list(paths.items())[:_QUICK_IMAGES]}
    for simulation in SIMULATED:
        pair = simulation.pair(settings.cache)
        for which in ("reference", "input"):
            name = f"simulated {simulation.density} {simulation.seed}, {which}"
            paths[name] = getattr(pair, which)
    return {name: unit_range(read_image(path)) for name, path in paths.items()}


def side_for(image: Image, corners: str) -> int:
    """Return the side of the largest square window that stays inside at every rotation."""
    side = min(image.shape)
    if corners == WHOLE:
        side = int((side - 3 * LARGEST_SHIFT_PX) / np.sqrt(2))
    return min(side, LONGEST_SIDE_PX)


def search_all(settings: Settings) -> list[Found]:
    """Put poses between windows of all images, and search for them."""
    found = []
    for seed, (name, image) in enumerate(read_images(settings).items()):
        for range_ in RANGES:
            for corners, variance in variants(range_):
                injection = Injection(range_.draw(seed), corners, variance, seed)
                side = side_for(image, corners)
                for method in range_.methods:
                    for similarity in SIMILARITIES:
                        one = search(
                            name,
                            range_.name,
                            image,
                            (side, side),
                            injection,
                            method,
                            similarity,
                            range_.limits,
                        )
                        found.append(one)
        print(f"{name}: {len(found)} searches so far")
    return found


def variants(range_: Range) -> list[tuple[str, float]]:
    """Return the corners and noise variances that a range is run with."""
    whole = [(WHOLE, variance) for variance in NOISE_VARIANCES]
    return [*whole, (MASKED, 0.0), (BLACK, 0.0)] if range_ is SMALL else whole


def search_as_thesis(settings: Settings) -> list[Found]:
    """Search for the poses of [Patel2017] in images of the same sizes, in `ESTIMATES`' order."""
    found = []
    for estimates in ESTIMATES:
        name, (columns, rows) = STAND_INS[estimates.image]
        image = unit_range(read_image(settings.data / name))
        for seed, (degrees, x, y) in enumerate(ACTUAL):
            injection = Injection(
                Pose(degrees, 1.0, (x, y)), MASKED, estimates.noise_variance, seed
            )
            limits = SearchLimits(_RADIUS_PX, 30.0)
            found.append(
                search(
                    estimates.image,
                    "[Patel2017]",
                    image,
                    (rows, columns),
                    injection,
                    RADON,
                    SIMILARITIES[0],
                    limits,
                )
            )
    return found


def search(
    name: str,
    range_name: str,
    image: Image,
    shape: tuple[int, int],
    injection: Injection,
    method: str,
    similarity: str,
    limits: SearchLimits,
) -> Found:
    """Put a pose between two windows of an image, and search for it."""
    reference, input = injection.windows(image, shape)
    with threads(1) as context:
        started = time.perf_counter()
        settings = SimilaritySettings(similarity)
        candidates = METHODS[method](reference, input, limits, settings, context)
        seconds = time.perf_counter() - started
    truth, best = injection.pose, candidates[0]
    turned, error = pose_errors(best.pose, truth, shape)
    right, down = (float(e) for e in np.abs(np.subtract(best.pose.shift_px, truth.shift_px)))
    return Found(
        name,
        range_name,
        method,
        similarity,
        injection.corners,
        injection.noise_variance,
        truth.rotation_deg,
        truth.scale,
        turned,
        error,
        (right, down),
        best.height,
        seconds,
    )


def goals(found: Sequence[Found], enough: bool) -> list[Goal]:
    """Return the goals, with their results; `reached` is None if not `enough` was run."""
    made = []
    for range_ in RANGES:
        for method in range_.methods:
            some = [
                one
                for one in found
                if (one.range, one.method, one.corners) == (range_.name, method, WHOLE)
                and one.noise_variance == 0
                and one.similarity == SIMILARITIES[0]
            ]
            turned = float(np.median([one.rotation_error_deg for one in some]))
            error = float(np.median([one.error_px for one in some]))
            largest = _ROTATION_DEG[method]
            made.append(
                Goal(
                    f"{method}, {range_.name}: median errors of {len(some)} images",
                    f"at most {largest:g}° and {_ERROR_PX:g} px",
                    f"{turned:.3f}° and {error:.3f} px",
                    (turned <= largest and error <= _ERROR_PX) if enough else None,
                )
            )
    return made


def errors_table(found: Sequence[Found]) -> Table:
    """Return median and largest errors by range, method and degradation."""
    groups: dict[tuple[Any, ...], list[Found]] = {}
    for one in found:
        key = (one.method, one.range, one.corners, one.noise_variance, one.similarity)
        groups.setdefault(key, []).append(one)
    head = (
        "method",
        "poses",
        "corners",
        "noise variance",
        "similarity",
        "images",
        "within 1 px",
        "median °",
        "largest °",
        "median px",
        "largest px",
        "median s",
    )
    rows = [
        [
            *(f"{part:g}" if isinstance(part, float) else part for part in key),
            str(len(some)),
            str(sum(one.error_px <= 1 for one in some)),
            *_median_and_largest([one.rotation_error_deg for one in some]),
            *_median_and_largest([one.error_px for one in some]),
            f"{np.median([one.seconds for one in some]):.2f}",
        ]
        for key, some in sorted(groups.items(), key=lambda item: item[0])
    ]
    return Table("Errors", head, rows)


def _median_and_largest(errors: Sequence[float]) -> list[str]:
    return [f"{np.median(errors):.3f}", f"{max(errors):.3f}"]


def thesis_table(found: Sequence[Found]) -> Table:
    """Return the errors of [Patel2017] tables 3.3 and 3.4 beside ours; `found` in search order."""
    rows = []
    for index, estimates in enumerate(ESTIMATES):
        own = found[index * len(ACTUAL) : (index + 1) * len(ACTUAL)]
        for actual, errors, one in zip(ACTUAL, estimates.errors(), own, strict=True):
            rows.append(
                [
                    _thesis_image(estimates),
                    f"{estimates.noise_variance:g}",
                    ", ".join(f"{value:g}" for value in actual),
                    *(f"{error:g}" for error in errors),
                    f"{one.rotation_error_deg:.3f}",
                    *(f"{error:.3f}" for error in one.shift_errors_px),
                ]
            )
    head = (
        "image (P's size)",
        "noise variance",
        "θ (°), tx, ty (px)",
        *(f"P: error of {what}" for what in ("θ", "tx", "ty")),
        *(f"here: error of {what}" for what in ("θ", "tx", "ty")),
    )
    return Table("[Patel2017], tables 3.3 and 3.4", head, rows)


def _thesis_image(estimates: Estimates) -> str:
    return f"{estimates.image} ({'×'.join(map(str, SIZES[estimates.image]))})"
