"""Reference and input on one grid, for the swipe and checkerboard of a report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import NoOverlapError
from ..geometry.transform import Transform
from ..raster_names import file_name
from ..rasters.grid import FloatArray, Grid, PointFunction, require_both_or_none
from ..rasters.pair import Image, ImagePair
from ..rasters.patch import Patch
from ..rasters.reading import RasterSource
from ..rasters.target_grids import covering_grid
from ..report import pictures


@dataclass(frozen=True)
class Comparison:
    """Overviews of one grid as data URIs.

    Parameters
    ----------
    reference, nominal, registered
        The reference, the input placed by its georeferencing, and the input placed by a transform
        (None: there is no transform).
    masks
        Tints of masked pixels, transparent elsewhere, by the names of these pictures.
    backdrop
        The reference, small and faint.
    reference_name, input_name
        Names of the files.
    width, height
        Size in pixels.
    """

    reference: str
    nominal: str
    registered: str | None
    backdrop: str
    reference_name: str
    input_name: str
    width: int
    height: int
    masks: Mapping[str, str]

    @classmethod
    def of(cls, pair: ImagePair, to_input_px: PointFunction | None) -> Comparison:
        """Draw the images of a pair; `to_input_px` takes map positions to the input's pixels."""
        grid = pictures.overview_grid(pair.grid)
        bare = without_masks(pair)
        reference = bare.reference_patch(grid)
        seen = pictures.grey_picture(reference)
        shown = {"reference": pictures.jpeg_uri(seen)}
        masks = {}
        if pair.reference.mask is not None:
            masks["reference"] = _tint(reference, pair.reference_patch(grid))
        ways: dict[str, PointFunction] = {"nominal": pair.nominal_px}
        if to_input_px is not None:
            ways["registered"] = pictures.overview_positions(to_input_px, grid)
        for name, to_px in ways.items():
            patch = bare.input_patch(grid, to_px)
            shown[name] = pictures.jpeg_uri(pictures.grey_picture(patch))
            if pair.input.mask is not None:
                masks[name] = _tint(patch, pair.input_patch(grid, to_px))
        return cls(
            shown["reference"],
            shown["nominal"],
            shown.get("registered"),
            pictures.jpeg_uri(pictures.backdrop(seen)),
            file_name(pair.reference.source.path),
            file_name(pair.input.source.path),
            grid.width,
            grid.height,
            masks,
        )


def without_masks(pair: ImagePair) -> ImagePair:
    """Return a pair without masks, so that its images are shown whole."""
    return replace(
        pair,
        reference=replace(pair.reference, mask=None),
        input=replace(pair.input, mask=None),
    )


def _tint(patch: Patch, masked: Patch) -> str:
    return pictures.tint_uri(patch.valid & ~masked.valid)


def compare(reference: RasterSource, input: RasterSource, transform: Transform) -> Comparison:
    """Draw the reference and the registered input on the reference's grid, where they overlap.

    Raises
    ------
    GeoreferencingError
        Only one of the reference and the transform has a CRS.
    NoOverlapError
        The registered input does not overlap the reference.
    """
    grid = reference.grid
    require_both_or_none(grid.crs, transform.crs, f"{reference.path} and the transform")
    try:
        common = covering_grid(grid, _overlap(grid, transform), within=True)
    except NoOverlapError as error:
        raise NoOverlapError(f"{input.path}, as registered, misses {reference.path}") from error
    pair = ImagePair(Image(reference), Image(input), common, common.size, common)
    return Comparison.of(pair, transform.of_map(grid.crs))


def _overlap(grid: Grid, transform: Transform) -> FloatArray:
    """Return positions on a grid's map, (n, 2), that enclose the part of an input on the grid.

    Both outlines are needed: that of an input of the whole Earth folds where the grid's longitudes
    have another range.
    """
    footprint = transform.inverse(transform.input_grid.outline())
    own = grid.pixel_to_map(grid.outline())
    shown = transform.input_grid.contains(transform.of_map(grid.crs)(own))
    return np.concatenate([grid.to_own_map(footprint, transform.crs), own[shown]])
