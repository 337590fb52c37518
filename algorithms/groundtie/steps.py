"""The steps of a registration, one by one, on arrays.

The steps of `coregister` can be done one by one, or in part: the similarity surface of two windows,
the peak of a surface, tie points of two images near a model, a robust fit to points, the verdict on
a model. Images are given as to the tools: arrays, files, open datasets.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike, NDArray

from .arrays import Raster
from .context import Context, threads
from .errors import ParameterError, TooFewPointsError
from .geometry.estimation import Estimate, fit_without_blocks
from .geometry.fitting import require_determined
from .geometry.models import KINDS, Model, shift_model
from .geometry.robust import find_consensus, fit_robustly
from .geometry.terrain_model import TerrainModel
from .geometry.tie_points import TiePoints
from .geometry.transform import as_positions
from .kinds import Choice, Number
from .matching.surface_fit import FIT_RADIUS_PX, check_points
from .memory import bounded_cache
from .rasters.patch import Patch
from .rasters.reading import open_raster
from .registration.opening import open_pair
from .registration.pipeline import judge_estimate, mask_pair
from .registration.specification import COREGISTER, Specification
from .registration.stages import Stages
from .registration.verdict import Verdict, judge_search
from .similarity.description import BORDER_PX
from .similarity.peak import Peak
from .similarity.peak import find_peak as peak_of
from .similarity.surface import SIMILARITIES, SimilaritySettings, Surface, describe
from .similarity.surface import similarity_surface as surface_of

__all__ = [
    "Fit",
    "Peak",
    "find_peak",
    "fit_model",
    "judge",
    "match_chips",
    "similarity_surface",
]


# Assumed standard deviation of matches, in pixels, if no better value is given.
_USUAL_SIGMA_PX = 0.25

_RADIUS = Number(help="Largest shift.", unit="px", minimum=0, integer=True)
# With a radius of 0, a surface has no peak inside.
_MATCH_RADIUS = replace(_RADIUS, minimum=1)
_REACH = replace(_RADIUS, integer=False)
_SIZE = Number(help="Size, above 0.")
_SEED = Number(help="Seed of random numbers.", minimum=0, integer=True)
_KIND = Choice(help="Kind of model.", choices=KINDS)
_SIMILARITY = Choice(help="What is compared.", choices=SIMILARITIES)


def similarity_surface(
    reference: ArrayLike, input: ArrayLike, radius_px: int, similarity: str = "fused"
) -> Surface:
    """Return the similarity of two windows over shifts of one against the other.

    Parameters
    ----------
    reference, input
        Grey values of the same size, (h, w), of nominally the same ground. Masked pixels and pixels
        that are not finite do not count. A border of `radius_px` + 8 pixels is not part of the chip
        that is compared.
    radius_px
        Largest shift.
    similarity
        One of `similarity.surface.SIMILARITIES`.

    Returns
    -------
    Shape (2 `radius_px` + 1, 2 `radius_px` + 1), in robust standard deviations. Rows and columns
    are shifts, down and right, of the input's content from the reference's. The surface is 0 if one
    of the windows is constant.

    Raises
    ------
    ParameterError
        The windows are too small or differ in size, or there is no such radius or similarity.
    """
    radius_px = int(_RADIUS.check("radius_px", radius_px))
    similarity = _SIMILARITY.check("similarity", similarity)
    windows = [_patch(image) for image in (reference, input)]
    height, width = windows[0].values.shape
    if windows[1].values.shape != (height, width):
        raise ParameterError("reference and input must be windows of the same size")
    chip_pixels = (height - 2 * (radius_px + BORDER_PX), width - 2 * (radius_px + BORDER_PX))
    if min(chip_pixels) < 1:
        least = 2 * (radius_px + BORDER_PX) + 1
        raise ParameterError(f"windows must have {least} pixels a side for a radius of {radius_px}")
    compared = windows[0].inner(radius_px + BORDER_PX), windows[1].inner(BORDER_PX)
    if any(window.is_flat for window in compared):
        # The mutual information of a constant window is rounding noise, in which a peak would be
        # found.
        return np.zeros((2 * radius_px + 1,) * 2, np.float32)
    settings = SimilaritySettings(similarity)
    template, search = (describe(w, chip_pixels[0] * chip_pixels[1], settings) for w in windows)
    return surface_of(template.inner(radius_px), search, radius_px, settings)


def find_peak(surface: ArrayLike) -> Peak:
    """Return the highest peak of a surface: its shift, covariance and height.

    Parameters
    ----------
    surface
        As of `similarity_surface`, shape (2 r + 1, 2 q + 1), shift 0 at its centre; unknown values
        are 0, the background's value.

    Raises
    ------
    ParameterError
        The surface has no centre, or holds values that are not finite numbers.
    """
    values = np.asarray(surface)
    if values.ndim != 2 or 0 in np.mod(values.shape, 2):
        raise ParameterError(
            f"a surface must have odd numbers of rows and columns, not {values.shape}"
        )
    if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
        raise ParameterError("a surface must hold finite numbers: 0 where nothing is known")
    return peak_of(values)


def match_chips(
    reference: Any,
    input: Any,
    model: Model | None = None,
    radius_px: int = FIT_RADIUS_PX,
    spec: Specification = COREGISTER,
    context: Context | None = None,
) -> TiePoints:
    """Return tie points of two images near a model.

    Chips lie between the blocks that are held out for `judge`, and use no pixel of them.

    Parameters
    ----------
    reference, input
        The images, as `rasters.reading.open_raster` takes them.
    model
        The misregistration on the map as known so far; None: none.
    radius_px
        Largest error of the model, in matching pixels. All shifts of each chip are compared: time
        grows with the square of the radius. For larger errors, use the search of `coregister`.
    spec
        How chips are laid out, masked and compared.
    context
        Threads and progress; None: a thread for each processor.

    Raises
    ------
    ParameterError
        The radius is no whole number of at least 1, or an argument has a wrong type.
    """
    model = shift_model(0.0, 0.0) if model is None else model
    _require("model", model, Model)
    radius_px = int(_MATCH_RADIUS.check("radius_px", radius_px))
    with _stages(reference, input, spec, context) as (stages, running):
        places = stages.matcher.fit_places(stages.held_out.layout)
        surfaces = stages.matcher.match(model, places, radius_px, running)
        points = check_points(stages.masked.pair, surfaces, model)
        points = points.take(points.located)
        return replace(points, is_check=np.zeros(len(points), bool))


@dataclass(frozen=True)
class Fit:
    """A robust fit.

    Parameters
    ----------
    model
        Maps positions of the reference to nominal positions of the input; `model.inverse` maps
        back.
    inliers
        Which pairs it was fitted to, shape (n,).
    sigma
        Standard deviation of the inliers' residuals along an axis, in the positions' unit.
    """

    model: Model
    inliers: NDArray[np.bool_]
    sigma: float


def fit_model(
    kind: str,
    xy: ArrayLike,
    nominal_xy: ArrayLike,
    *,
    pixel_size: float = 1.0,
    tolerance_px: float = 3.0,
    radius_px: float = FIT_RADIUS_PX,
    seed: int = 0,
) -> Fit:
    """Fit a model to pairs of positions, many of which may be outliers.

    Parameters
    ----------
    kind
        One of `geometry.models.KINDS`.
    xy, nominal_xy
        Positions in the reference and in the input, shape (n, 2), in one coordinate system: pixels
        of two arrays, or map positions (see `Transform.nominal_xy`).
    pixel_size
        Size of a pixel in units of the positions.
    tolerance_px
        Largest residual of pairs that agree with a first model of degree 1, their consensus.
    radius_px
        Largest distance of outliers from the truth.
    seed
        Seed of the consensus' random samples.

    Raises
    ------
    ParameterError
        There is no such kind of model, the positions are no pairs of finite numbers, or a number is
        out of its range.
    TooFewPointsError
        Too few pairs agree with a model of this kind, or those that do cannot determine it: they
        lie at one place, or on a line.
    """
    kind = _KIND.check("kind", kind)
    pixel_size = _above_0("pixel_size", pixel_size)
    tolerance_px = _above_0("tolerance_px", tolerance_px)
    radius_px = _REACH.check("radius_px", radius_px)
    seed = int(_SEED.check("seed", seed))
    px, nominal_px = (as_positions(p).reshape(-1, 2) / pixel_size for p in (xy, nominal_xy))
    if len(px) != len(nominal_px):
        raise ParameterError(
            f"{len(px)} positions in the reference, but {len(nominal_px)} in the input"
        )
    finite = np.isfinite(np.hstack([px, nominal_px])).all(axis=1)
    if not finite.all():
        raise ParameterError(
            f"positions must be finite numbers; {(~finite).sum()} of {len(px)} are not"
        )
    if len(px) < 3:
        raise TooFewPointsError(f"a robust fit needs at least 3 points; there are {len(px)}")
    require_determined(kind, px)
    # A user's own points may be those of images of any rotation and scale.
    start = find_consensus(px, nominal_px, tolerance_px, kind, seed, np.inf)
    model, mixture = fit_robustly(
        kind,
        px,
        nominal_px,
        _USUAL_SIGMA_PX**2,
        start,
        (2 * radius_px + 1) ** 2,
    )
    require_determined(kind, px[mixture.inliers])
    residuals = (nominal_px - model(px))[mixture.inliers]
    # The mixture's own sigma is clipped to the usual range of matches.
    sigma = float(np.sqrt((residuals**2).mean())) * pixel_size
    return Fit(model.on_map(Affine.scale(pixel_size)), mixture.inliers, sigma)


def judge(
    reference: Any,
    input: Any,
    model: Model,
    points: TiePoints,
    spec: Specification = COREGISTER,
    context: Context | None = None,
) -> Verdict:
    """Return the verdict on a model, wherever it comes from, by chips in held-out blocks.

    All rules of a registration apply. They require a model that was fitted without those blocks, as
    with points of `match_chips`.

    Parameters
    ----------
    reference, input
        The images, as `rasters.reading.open_raster` takes them.
    model
        The misregistration on the map.
    points
        The points that it was fitted to, outliers rejected (see `TiePoints.reject`).
    spec
        How the images are inspected, masked and compared, and the largest accepted error.
    context
        Threads and progress; None: a thread for each processor.

    Raises
    ------
    ParameterError
        An argument has a wrong type.
    """
    _require("model", model, Model)
    _require("points", points, TiePoints)
    if isinstance(model, TerrainModel):
        raise ParameterError("points alone do not determine a model of terrain: use coregister")
    with _stages(reference, input, spec, context) as (stages, running):
        pair = stages.masked.pair
        transform = pair.transform(model)
        used = points.take(points.used)
        px = pair.grid.map_to_pixel(used.reference_xy)
        nominal_px = pair.grid.map_to_pixel(used.nominal_xy(transform))
        try:
            without_blocks = fit_without_blocks(model.kind, px, nominal_px, np.ones(len(px)))
            estimate = Estimate(transform, points, without_blocks)
            check = stages.check(model, running)
            return judge_estimate(stages, estimate, check, running)[1]
        except TooFewPointsError as error:
            return judge_search(error)


@contextmanager
def _stages(
    reference: Any, input: Any, spec: Specification, context: Context | None
) -> Iterator[tuple[Stages, Context]]:
    """Open a pair and put the stages of its registration together."""
    _require("spec", spec, Specification)
    if context is not None:
        _require("context", context, Context)
    with (
        threads() if context is None else nullcontext(context) as running,
        bounded_cache(),
        open_pair(reference, input, spec, running.quiet()) as opened,
    ):
        yield Stages.of(opened.images, mask_pair(opened, spec, running.quiet()), spec), running


def _require(name: str, value: Any, kind: type) -> None:
    if not isinstance(value, kind):
        raise ParameterError(f"{name} must be a {kind.__name__}, not a {type(value).__name__}")


def _above_0(name: str, value: Any) -> float:
    number = _SIZE.check(name, value)
    if number <= 0:
        raise ParameterError(f"{name} must be above 0, not {number:g}")
    return number


def _patch(image: ArrayLike) -> Patch:
    values = np.asanyarray(image)
    if values.ndim != 2:
        raise ParameterError(f"a window must have the shape (h, w), not {values.shape}")
    with open_raster(Raster(values)) as source:
        return Patch(*source.read(source.window))
