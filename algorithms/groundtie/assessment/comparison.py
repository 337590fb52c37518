"""Reference and input, one over the other: what swipe and checkerboard of a report show."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..errors import GeoreferencingError, NoOverlapError
from ..geometry.transform import Transform
from ..rasters.grid import FloatArray, Grid, reproject
from ..rasters.pair import Image, ImagePair
from ..rasters.reading import RasterSource
from ..rasters.target_grids import covering_grid
from ..report import pictures


@dataclass(frozen=True)
class Comparison:
    """Overviews of one grid as data URIs.

    Parameters
    ----------
    reference, claimed, registered
        The reference, the input where it claims to be, and the input where a transform puts it
        (None: there is no transform).
    backdrop
        The reference, small and faint.
    reference_name, input_name
        Names of the files.
    width, height
        Size in pixels.
    """

    reference: str
    claimed: str
    registered: str | None
    backdrop: str
    reference_name: str
    input_name: str
    width: int
    height: int

    @classmethod
    def of(cls, pair: ImagePair, to_input_px: pictures.ToPixel | None) -> Comparison:
        """Draw the images of a pair; `to_input_px` takes map positions to the input's pixels."""
        grid = pictures.overview_grid(pair.grid)
        reference = pictures.grey_picture(pair.reference_patch(grid))
        registered = None
        if to_input_px is not None:
            positions = pictures.overview_positions(to_input_px, grid)
            registered = _uri(pair, grid, positions)
        return cls(
            pictures.jpeg_uri(reference),
            _uri(pair, grid, pair.nominal_px),
            registered,
            pictures.jpeg_uri(pictures.backdrop(reference)),
            Path(pair.reference.source.path).name,
            Path(pair.input.source.path).name,
            grid.width,
            grid.height,
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


def _uri(pair: ImagePair, grid: Grid, to_input_px: pictures.ToPixel) -> str:
    return pictures.jpeg_uri(pictures.grey_picture(pair.input_patch(grid, to_input_px)))
