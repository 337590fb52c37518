"""Reference and input, one over the other: what swipe and checkerboard of a report show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import GeoreferencingError, NoOverlapError
from ..geometry.transform import Transform
from ..rasters.grid import FloatArray, reproject
from ..rasters.pair import Image, ImagePair
from ..rasters.reading import RasterSource
from ..rasters.target_grids import covering_grid
from ..report import pictures


@dataclass(frozen=True)
class Comparison:
    """Overviews of one grid as data URIs.

    Parameters
    ----------
    reference, nominal, registered
        The reference, the input where its georeferencing puts it, and the input where a transform
        puts it (None: there is no transform). What is masked is tinted.
    backdrop
        The reference, small and faint.
    reference_name, input_name
        Names of the files.
    width, height
        Size in pixels.
    is_masked
        Whether a mask may tint the pictures.
    """

    reference: str
    nominal: str
    registered: str | None
    backdrop: str
    reference_name: str
    input_name: str
    width: int
    height: int
    is_masked: bool = False

    @classmethod
    def of(cls, pair: ImagePair, to_input_px: pictures.ToPixel | None) -> Comparison:
        """Draw the images of a pair; `to_input_px` takes map positions to the input's pixels."""
        grid = pictures.overview_grid(pair.grid)
        bare = replace(
            pair,
            reference=replace(pair.reference, mask=None),
            input=replace(pair.input, mask=None),
        )
        plain = bare.reference_patch(grid)
        masked = pair.reference_patch(grid) if pair.reference.mask is not None else plain

        def input_uri(to_px: pictures.ToPixel) -> str:
            patch = bare.input_patch(grid, to_px)
            shown = pair.input_patch(grid, to_px) if pair.input.mask is not None else patch
            return pictures.jpeg_uri(pictures.tinted_picture(patch, shown.valid))

        registered = None
        if to_input_px is not None:
            registered = input_uri(pictures.overview_positions(to_input_px, grid))
        return cls(
            pictures.jpeg_uri(pictures.tinted_picture(plain, masked.valid)),
            input_uri(pair.nominal_px),
            registered,
            pictures.jpeg_uri(pictures.backdrop(pictures.grey_picture(plain))),
            Path(pair.reference.source.path).name,
            Path(pair.input.source.path).name,
            grid.width,
            grid.height,
            pair.is_masked,
        )


def compare(reference: RasterSource, input: RasterSource, transform: Transform) -> Comparison:
    """Draw the reference and the registered input on the reference's grid, where they overlap.

    Raises
    ------
    GeoreferencingError
        Only one of the reference and the transform has a CRS.
    NoOverlapError
        The registered input does not lie on the reference.
    """
    grid = reference.grid
    if (grid.crs is None) != (transform.crs is None):
        raise GeoreferencingError(f"only one of {reference.path} and the transform has a CRS")

    def to_input_px(xy: FloatArray) -> FloatArray:
        return transform(reproject(xy, grid.crs, transform.crs))

    footprint = transform.inverse(transform.input_grid.outline())
    try:
        common = covering_grid(grid, reproject(footprint, transform.crs, grid.crs), within=True)
    except NoOverlapError as error:
        raise NoOverlapError(f"{input.path}, as registered, misses {reference.path}") from error
    size = common.width, common.height
    pair = ImagePair(Image(reference), Image(input), common, size, common)
    return Comparison.of(pair, to_input_px)
