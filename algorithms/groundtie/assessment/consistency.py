"""Registration consistency: the misclosure of transforms that should cancel out.

Consistency needs no points, but is no measure of accuracy: transforms that are wrong in the same
way are consistent. Source: [Suri2010] eq 2.4 (two-way, after [Holden2000]) and eq 5.2
(three-way).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..errors import GeoreferencingError, NoOverlapError
from ..geometry.transform import Transform
from ..rasters.grid import FloatArray, Grid, mesh, reproject
from .point_errors import PointErrors

# Number of positions along the input's longer side at which consistency is measured.
_PLACES = 33


@dataclass(frozen=True)
class Leg:
    """One transform on the path from the map of one image to that of another.

    Parameters
    ----------
    name
        Its name in error messages.
    transform
        From reference to input.
    reverse
        Go from input to reference.
    """

    name: str
    transform: Transform
    reverse: bool = False

    @property
    def start_crs(self) -> CRS | None:
        """CRS of the map that the leg starts from."""
        return self.transform.input_grid.crs if self.reverse else self.transform.crs

    @property
    def end_crs(self) -> CRS | None:
        """CRS of the map that the leg leads to."""
        return self.transform.crs if self.reverse else self.transform.input_grid.crs

    def follow(self, xy: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Follow the leg from positions on the map of the starting image, shape (n, 2).

        Returns
        -------
        xy
            Positions on the other image's map, (m, 2), of those inside the transform's input.
        inside
            Which positions are inside, shape (n,).
        """
        own = self.transform.input_grid
        px = own.map_to_pixel(own.to_own_map(xy, own.crs)) if self.reverse else self.transform(xy)
        inside = own.contains(px)
        px = px[inside]
        return (self.transform.inverse(px) if self.reverse else own.pixel_to_map(px)), inside


def consistency(transform: Leg, way: Sequence[Leg]) -> PointErrors:
    """Measure the misclosure of a transform and another path between its images.

    The path leads from the transform's input to its reference; the transform leads back. Two-way
    consistency has one leg: the registration of the reference to the input. Three-way consistency
    leads through a third image. The errors' mean length is the registration consistency of
    [Suri2010] eq 2.4.

    Parameters
    ----------
    transform
        The measured transform.
    way
        The legs from its input to its reference.

    Returns
    -------
    PointErrors
        At pixels all over the input, where all images overlap.

    Raises
    ------
    GeoreferencingError
        Only one of two maps that should be the same has a CRS.
    NoOverlapError
        There is no position that all transforms reach.
    """
    own = transform.transform.input_grid
    start_px = spread_over(own)
    xy, crs, name = own.pixel_to_map(start_px), own.crs, transform.name
    for leg in way:
        xy, inside = leg.follow(_entering(leg, xy, crs, name))
        start_px = start_px[inside]
        if len(start_px) == 0:
            names = ", ".join(one.name for one in (transform, *way))
            raise NoOverlapError(f"there is no place that all of these reach: {names}")
        crs, name = leg.end_crs, leg.name
    xy = _entering(transform, xy, crs, name)
    return PointErrors.of(transform.transform, xy, start_px)


def _entering(leg: Leg, xy: FloatArray, crs: CRS | None, name: str) -> FloatArray:
    """Return positions that the transform `name` led to, in the CRS that a leg starts from."""
    if (leg.start_crs is None) != (crs is None):
        raise GeoreferencingError(
            f"{leg.name} does not continue {name}: only one of the two maps has a CRS"
        )
    return reproject(xy, crs, leg.start_crs)


def spread_over(grid: Grid) -> FloatArray:
    """Return pixel positions (col, row) spread evenly over a grid, from border to border, (n, 2).

    No pixel is taken twice.
    """
    step = max(max(grid.size) / _PLACES, 1.0)
    axes = []
    for side in grid.size:
        count = max(round(side / step), 1)
        # At the centres of equal parts, as pixels of a grid.
        axes.append((np.arange(count) + 0.5) * side / count - 0.5)
    return mesh(*axes)
