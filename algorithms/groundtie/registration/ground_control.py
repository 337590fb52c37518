"""Ground control from a reference image: the pipeline between an oriented image and the map.

The image is projected onto the map by its RPCs, piece by piece as it is read, and registered there
as any other pair. The points that are found are carried back into the image.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..context import Context
from ..errors import NothingFoundError, TooFewPointsError
from ..geometry.accuracy import NOTHING_COMMON, Common
from ..geometry.judging import TOLERANCE_PX
from ..geometry.models import Model
from ..masks.used import INPUT
from ..rasters.grid import FloatArray, Grid
from ..rasters.pair import Image, ImagePair
from ..rasters.reading import RasterSource
from ..sensor.control_points import ControlPoints
from ..sensor.orientation import Orientation, sensor_grid
from .opening import OpenPair, pair_images
from .pipeline import begin, mask_pair, register
from .registration import Registration
from .sensor_input import OrientedImage
from .specification import Specification
from .stages import Stages
from .verdict import judge_search

# Search radius, in matching pixels, after a coarse shift was put into the RPCs. A shift above the
# tolerance of points is put there before they are matched: wrong RPCs project the image with the
# heights of other places.
_LEFT_PX = 20.0


@dataclass(frozen=True)
class GroundControl:
    """Matched ground control.

    Parameters
    ----------
    registration
        The judged registration on the map that it comes from.
    points
        The points, those of the fit first; None if there are none.
    common
        Displacement of all points alike, in pixels of the image.
    """

    registration: Registration
    points: ControlPoints | None
    common: Common = NOTHING_COMMON

    def accepted_points(self) -> ControlPoints:
        """Return the points.

        Raises
        ------
        NotRegisteredError
            They are refused.
        """
        self.registration.require_accepted("matched with")
        assert self.points is not None
        return self.points


def match_ground_control(
    image: OrientedImage,
    reference: RasterSource,
    spec: Specification,
    bands: tuple[int | None, int | None],
    masks: tuple[Any, Any],
    stack: ExitStack,
    context: Context,
) -> GroundControl:
    """Match an oriented image with a reference.

    Parameters
    ----------
    image
        The image, located on the reference's map.
    reference
        The image whose georeferencing is right.
    spec
        How they are matched.
    bands, masks
        Those of the reference and of the image; see `opening.open_pair`.
    stack
        Keeps rasters open as long as the result is used.
    context
        Threads, progress and seed.
    """
    started = time.perf_counter()

    def opened(by: Orientation, spec: Specification) -> OpenPair:
        located = replace(image.source, grid=sensor_grid(image.source, by))
        images = Image(reference, bands[0]), Image(located, bands[1])
        return pair_images(*images, spec, context.quiet(), masks, stack, started)

    by = image.orientation
    pair = opened(by, spec)
    masked = mask_pair(pair, spec, context.part(0.0, 0.1))
    begun = begin(pair, masked, spec)
    if begun.verdict.rule:
        return GroundControl(begun, None)
    context.update(0.1, "searching for the coarse shift")
    try:
        coarse = Stages.of(pair.images, masked, spec).coarse(context.part(0.1, 0.4))
    except (NothingFoundError, TooFewPointsError) as error:
        refused = replace(begun, verdict=judge_search(error))
        return GroundControl(refused, None)
    shift_px = _shift_in_image(pair.pair, by, coarse)
    if np.hypot(*shift_px) > TOLERANCE_PX:
        by = replace(by, rpc=by.rpc.shifted(shift_px))
        spec = replace(spec, search_radius_m=_LEFT_PX * pair.pair.grid.pixel_size_m)
        pair = opened(by, spec)
        if masked.used.image == INPUT:
            masked = mask_pair(pair, spec, context.quiet())
        else:
            masked = masked.on(pair.pair)
    registration = register(pair, masked, spec, context.part(0.4, 1.0))
    evidence, points = registration.evidence, registration.tie_points
    if evidence is None or points is None:
        return GroundControl(registration, None)
    to_image = _matching_to_image(evidence.grid, by, points.reference_xy)
    points = replace(
        points, covariance_px2=to_image @ points.covariance_px2 @ to_image.swapaxes(1, 2)
    )
    heights = image.orientation.heights_at(points.reference_xy)
    control = ControlPoints.of(points, heights, image.orientation.crs)
    # As seen in the middle of the matched part.
    grid, common = evidence.grid, evidence.error.common
    to_image = _matching_to_image(grid, by, grid.pixel_to_map([grid.centre_px]))[0]
    scale = float(np.sqrt(abs(np.linalg.det(to_image))))
    common = Common(to_image @ common.heights_px, scale * common.sigma_px)
    return GroundControl(registration, control, common)


def _shift_in_image(pair: ImagePair, orientation: Orientation, model: Model) -> FloatArray:
    """Return the shift of image positions against those of the RPCs, by a model on the map."""
    xy = pair.grid.pixel_to_map(pair.grid.places())
    shifts = orientation.to_px(model(xy)) - orientation.to_px(xy)
    return np.asarray(np.nanmedian(shifts, axis=0))


def _matching_to_image(grid: Grid, orientation: Orientation, xy: FloatArray) -> FloatArray:
    """Return the derivatives of image positions by pixels of a grid at map positions, (n, 2, 2)."""
    px = grid.map_to_pixel(xy)
    slopes = [
        orientation.to_px(grid.pixel_to_map(px + step))
        - orientation.to_px(grid.pixel_to_map(px - step))
        for step in (np.array([0.5, 0.0]), np.array([0.0, 0.5]))
    ]
    return np.nan_to_num(np.stack(slopes, axis=-1))
