"""Models on the map and the same models between pixel positions of a grid."""

from __future__ import annotations

from affine import Affine

from ..geometry.fitting import fit_model
from ..geometry.models import Model
from ..rasters.grid import Grid


def on_grid(model: Model, grid: Grid) -> Affine:
    """Return a model of map positions, of degree 1, as an affine transform of a grid's pixels."""
    origin, right, down = grid.map_to_pixel(model(grid.pixel_to_map([[0, 0], [1, 0], [0, 1]])))
    along, across = right - origin, down - origin
    return Affine(along[0], across[0], origin[0], along[1], across[1], origin[1])


def compose(model: Model, correction: Model, level: Grid) -> Model:
    """Return the model of degree 1 on the map that first corrects on a level, then applies `model`.

    Parameters
    ----------
    model
        A model of map positions.
    correction
        A model of pixel positions of the level.
    level
        A grid on the map.
    """
    corrected = correction.on_map(level.centre_transform)
    corners = level.pixel_to_map(
        [[0, 0], [level.width, 0], [0, level.height], [level.width, level.height]]
    )
    return fit_model("affine", corners, model(corrected(corners)))
