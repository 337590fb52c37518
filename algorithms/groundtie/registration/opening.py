"""A pair of images, opened for registration on one matching grid, with the user's masks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..context import Context
from ..errors import ParameterError
from ..geometry.models import SHAPE_PRESERVING
from ..geometry.terrain import Terrain
from ..masks.used import MaskUsed
from ..rasters.grid import Grid, linear_part
from ..rasters.pair import Image, ImagePair, coarser_m, default_radius_m, make_pair
from ..rasters.reading import open_raster
from ..rasters.rendered import rendered
from .specification import FreeSearch, Specification
from .surface_masks import rendered_surface
from .user_masks import with_user_masks

# By how much the axes of pixels may differ if a model preserves shapes in pixels: rotated by 1°,
# positions 500 px from the centre are then wrong by less than half a pixel.
_SQUARE = 1.05


@dataclass(frozen=True)
class OpenPair:
    """Two images, open, with the masks that the user gave.

    Parameters
    ----------
    images
        The images without any mask, as keypoints are described in them.
    pair
        The images with the user's masks.
    user_mask
        The mask that a vector layer made; None: none.
    stack
        Keeps rasters open, and takes further masks.
    started
        When the work began, by `time.perf_counter`.
    """

    images: ImagePair
    pair: ImagePair
    user_mask: MaskUsed | None
    stack: ExitStack
    started: float


@contextmanager
def open_pair(
    reference: Any,
    input: Any,
    spec: Specification,
    context: Context,
    bands: tuple[int | None, int | None] = (None, None),
    masks: tuple[Any, Any] = (None, None),
) -> Iterator[OpenPair]:
    """Open two images and the masks that the user gave.

    Parameters
    ----------
    reference, input
        Rasters as `open_raster` takes them.
    spec
        How far the input may lie off, and at which pixel size both are matched.
    context
        Threads and progress.
    bands
        Numbers of the bands that are matched, from 1; None: the mean of all.
    masks
        For each image a `UserMask`, or a raster whose zeros take no part, a vector layer of the
        areas that take part, or a classifier; None: the whole image takes part.
    """
    started = time.perf_counter()
    with ExitStack() as stack:
        opened = [
            Image(stack.enter_context(open_raster(raster)), band)
            for raster, band in zip((reference, input), bands, strict=True)
        ]
        if spec.surface_view is not None:
            context.update(0.0, "rendering the surface model")
            opened[0] = rendered_surface(opened[0], spec.surface_view, stack, context.quiet())
        yield pair_images(opened[0], opened[1], spec, context, masks, stack, started)


def pair_images(
    reference: Image,
    input: Image,
    spec: Specification,
    context: Context,
    masks: tuple[Any, Any],
    stack: ExitStack,
    started: float,
) -> OpenPair:
    """Put two open images on a common matching grid, and the user's masks on them."""
    grid = input.source.grid
    if spec.light is not None:
        lit = rendered(reference.source, spec.light, reference.band)
        reference = Image(lit, 1)
    usual_m = spec.enlargement * coarser_m(reference.source.grid, grid)
    radius_m, rotation_deg, scale = spec.search_radius_m, spec.rotation_deg, spec.scale
    if not grid.is_georeferenced:
        radius_m = _free_radius_m(grid, spec.free) if radius_m is None else radius_m
        rotation_deg = spec.free.rotation_deg if rotation_deg is None else rotation_deg
        scale = spec.free.scale if scale is None else scale
    images = make_pair(
        reference,
        input,
        spec.matching_pixel_size_m or usual_m,
        radius_m,
        0.0 if rotation_deg is None else rotation_deg,
        1.0 if scale is None else scale,
    )
    _require_square(spec.model, images.grid)
    reach_m = images.limits.radius
    if radius_m is not None and radius_m > reach_m:
        unit = "m" if grid.is_georeferenced else "px"
        context.update(
            0.0,
            f"warning: a search radius of {radius_m:.6g} {unit} reaches beyond the images: all "
            f"shifts up to {reach_m:.4g} {unit} are searched, which may take minutes; a smaller "
            "one is faster and safer",
        )
    for note in images.notes():
        context.update(0.0, note)
    pair, used = with_user_masks(images, masks, stack, context.part(0.0, 0.02))
    return OpenPair(images, pair, used, stack, started)


def _require_square(kind: str, grid: Grid) -> None:
    """Refuse a model that preserves shapes in pixels whose shapes are not those on the ground."""
    if kind not in SHAPE_PRESERVING:
        return
    ground = np.diag(grid.metres_per_unit) @ linear_part(grid.transform)
    longer, shorter = np.linalg.svd(ground, compute_uv=False)
    if longer > _SQUARE * shorter:
        raise ParameterError(
            f"the {kind} model preserves shapes in pixels, and the reference's are "
            f"{longer / shorter:.3g} times as long as wide on the ground: give model affine"
        )


def usual_radius_m(reference: Grid, input: Grid, free: FreeSearch) -> float:
    """Return the default search radius for the input of a pair.

    Parameters
    ----------
    reference, input
        The grids of both images.
    free
        Search limits without georeferencing.
    """
    share_m = None if input.is_georeferenced else _free_radius_m(input, free)
    usual_m = default_radius_m(coarser_m(reference, input), reference.crs is not None)
    return usual_m if share_m is None else share_m


def _free_radius_m(grid: Grid, free: FreeSearch) -> float | None:
    return None if free.radius_share is None else free.radius_share * max(grid.size)


def open_terrain(pair: ImagePair, dem: Any, input_dem: Any | None) -> Terrain:
    """Return heights all over the area that a pair may show.

    Parameters
    ----------
    pair
        The images.
    dem, input_dem
        The ground's heights, and those that the input was orthorectified with; None: one height.

    Raises
    ------
    GeoreferencingError, NoOverlapError, RasterContentError
        The heights are not known where the images overlap.
    """
    corners = pair.surroundings.pixel_to_map(pair.surroundings.outline())
    left, bottom = corners.min(axis=0).tolist()
    right, top = corners.max(axis=0).tolist()
    crs = pair.grid.crs
    terrain = Terrain.open(dem, input_dem, crs, (left, bottom, right, top))
    terrain.require_cover(pair.grid, pair.input.source.grid, crs)
    return terrain
