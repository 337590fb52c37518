"""Ground control from a reference image: the steps from an oriented image to judged points.

The image is projected onto the map by its RPCs, piece by piece as it is read, and matched there
as any other pair; what is found is carried back into the image.
"""

from __future__ import annotations

from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import (
    GeoreferencingError,
    NothingFoundError,
    NotRegisteredError,
    TooFewPointsError,
)
from ..geometry.models import Model
from ..masks.choice import MaskUsed
from ..matching.layout import lay_out_chips
from ..matching.local import AUTO, LocalSearch
from ..matching.pyramid import find_coarse_model
from ..matching.rough import RoughSearch
from ..progress import SILENT, Progress
from ..rasters.grid import FloatArray
from ..rasters.pair import Image, ImagePair, default_radius_m, make_pair
from ..rasters.reading import open_raster
from ..sensor.control_points import ControlPoints
from ..sensor.orientation import Orientation, sensor_grid
from ..similarity.surface import SimilaritySettings
from .classifying import Classifying
from .masking import MaskRequest, by_what_is_left
from .registration import Registration, register
from .sensor_input import OrientedImage
from .verdict import refuse

# A rough shift beyond this, in matching pixels, is put into the RPCs before points are matched: by
# wrong RPCs the image is projected with the heights of other places.
_ROUGH_PX = 2.0

# After that so much is left to search for, in matching pixels.
_LEFT_PX = 20.0

# The rough shift in the image is the median over a lattice.
_NODES = 9


@dataclass(frozen=True)
class Matching:
    """How ground control is matched; the parameters of the tools that do it.

    Parameters
    ----------
    radius_m
        How far the RPCs may be wrong, in metres; None: 100 m or 20 pixels.
    settings
        How similarity is measured.
    mask
        What of the reference takes part.
    pixel_size_m, chip_px
        As `make_pair` and `lay_out_chips` take them.
    forward_backward_px
        Largest distance between a match and its match back.
    max_error_px
        Largest error at check points.
    seed
        Of random samples.
    classifying
        Whether a classifier tells what of the image takes part.
    band
        Band of the image that is matched; None: the mean of all.
    """

    radius_m: float | None
    settings: SimilaritySettings
    mask: MaskRequest
    pixel_size_m: float | None
    chip_px: int | None
    forward_backward_px: float
    max_error_px: float
    seed: int
    classifying: Classifying
    band: int | None = None


@dataclass(frozen=True)
class GroundControl:
    """Matched ground control.

    Parameters
    ----------
    registration
        The judged registration on the map that it comes from.
    points
        The points, those of the fit first; None if there are none.
    mask
        The mask that was used.
    """

    registration: Registration
    points: ControlPoints | None
    mask: MaskUsed

    def accepted(self) -> ControlPoints:
        """Return the points.

        Raises
        ------
        NotRegisteredError
            They are refused.
        """
        pair, verdict = self.registration.pair, self.registration.verdict
        if not verdict.accepted or self.points is None:
            raise NotRegisteredError(
                f"{pair.input.source.path} was not matched with {pair.reference.source.path}: "
                f"{verdict.reason}",
                verdict,
            )
        return self.points


def open_reference(path: Path, band: int | None, mask: Path | None, stack: ExitStack) -> Image:
    """Open a reference image; it needs a CRS, as RPCs lead to longitude and latitude.

    Raises
    ------
    GeoreferencingError
        It has none.
    """
    source = stack.enter_context(open_raster(path))
    if source.grid.crs is None:
        raise GeoreferencingError(f"{path} has no CRS")
    shown = None if mask is None else stack.enter_context(open_raster(mask))
    return Image(source, band, shown)


def match_ground_control(
    image: OrientedImage,
    reference: Image,
    matching: Matching,
    executor: Executor,
    stack: ExitStack,
    progress: Progress,
) -> GroundControl:
    """Match an oriented image with a reference.

    Parameters
    ----------
    image
        The image, located on the reference's map.
    reference
        The image whose georeferencing is right.
    matching
        How.
    executor
        Threads to work in.
    stack
        Keeps what is open as long as the result is used.
    progress
        Is told of every step.
    """
    source, orientation = image.source, image.orientation

    def paired(by: Orientation, radius_m: float | None) -> ImagePair:
        located = replace(source, grid=sensor_grid(source, by))
        pair = make_pair(reference, Image(located, matching.band), matching.pixel_size_m, radius_m)
        if reference_mask is not None:
            pair = replace(pair, reference=replace(pair.reference, mask=reference_mask))
        return matching.classifying.apply(pair, stack, SILENT)

    def search_in(pair: ImagePair) -> LocalSearch:
        layout = lay_out_chips(pair, matching.chip_px)
        local = LocalSearch(
            pair, layout, matching.settings, forward_backward_px=matching.forward_backward_px
        )
        return by_what_is_left(local, mask)

    reference_mask = reference.mask
    pair = paired(orientation, matching.radius_m)
    pair, mask = matching.mask.apply(pair, stack, progress.part(0.0, 0.1))
    reference_mask, local = pair.reference.mask, search_in(pair)
    radius_m = default_radius_m(pair.grid) if matching.radius_m is None else matching.radius_m
    by = orientation
    progress.update(0.1, "searching for the rough shift")
    try:
        coarse = find_coarse_model(
            pair, local, RoughSearch(radius_m), executor, progress.part(0.1, 0.4)
        )
    except (NothingFoundError, TooFewPointsError) as error:
        return GroundControl(Registration(pair, local, None, None, refuse(str(error))), None, mask)
    shift_px = _shift_in_image(pair, orientation, coarse)
    if np.hypot(*shift_px) > _ROUGH_PX:
        by = orientation.with_rpc(orientation.rpc.shifted(shift_px))
        radius_m = _LEFT_PX * pair.grid.pixel_size_m
        pair = paired(by, radius_m)
        local = search_in(pair)
    rough = RoughSearch(radius_m)
    registration = register(
        pair,
        local,
        rough,
        AUTO,
        matching.max_error_px,
        matching.seed,
        executor,
        progress.part(0.4, 1.0),
    )
    points = registration.points
    if points is None:
        return GroundControl(registration, None, mask)
    to_image = _matching_to_image(pair, by, points.reference_xy)
    points = replace(
        points, covariance_px2=to_image @ points.covariance_px2 @ to_image.swapaxes(1, 2)
    )
    heights = orientation.heights_at(points.reference_xy)
    points = points.reject(~np.isfinite(heights), "no height")
    heights = np.where(np.isfinite(heights), heights, 0.0)
    return GroundControl(registration, ControlPoints(points, heights, orientation.crs), mask)


def _shift_in_image(pair: ImagePair, orientation: Orientation, model: Model) -> FloatArray:
    """Return by how much image positions differ from what RPCs say, by a model on the map."""
    cols, rows = np.meshgrid(
        np.linspace(0, pair.grid.width - 1, _NODES), np.linspace(0, pair.grid.height - 1, _NODES)
    )
    xy = pair.grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    shifts = orientation.to_px(model(xy)) - orientation.to_px(xy)
    return np.asarray(np.nanmedian(shifts, axis=0))


def _matching_to_image(pair: ImagePair, orientation: Orientation, xy: FloatArray) -> FloatArray:
    """Return the derivatives of image positions by matching pixels at map positions, (n, 2, 2)."""
    px = pair.grid.map_to_pixel(xy)
    slopes = [
        orientation.to_px(pair.grid.pixel_to_map(px + step))
        - orientation.to_px(pair.grid.pixel_to_map(px - step))
        for step in (np.array([0.5, 0.0]), np.array([0.0, 0.5]))
    ]
    return np.nan_to_num(np.stack(slopes, axis=-1))
