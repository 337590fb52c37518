from __future__ import annotations

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st

from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.rasters.lattice import Lattice, lattice, row_strips


def plane(width: int, height: int) -> Grid:
    return Grid(PIXEL_COORDINATES, None, width, height)


def pixels(grid: Grid) -> np.ndarray:
    cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
    return grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))


def everywhere(nodes: Lattice) -> np.ndarray:
    return np.concatenate(
        [nodes.lines(rows) for rows in row_strips(nodes.grid.height, nodes.grid.width)], axis=1
    )


def saddle(xy: np.ndarray) -> np.ndarray:
    """Right in the middle of every square between nodes, however coarse they are."""
    x, y = xy.T / 100
    return np.column_stack([x**2 - y**2, x * y])


def ripples(xy: np.ndarray) -> np.ndarray:
    return np.column_stack([np.sin(xy[:, 0] / 9), np.cos(xy[:, 1] / 30), xy @ [0.1, -2]])


@pytest.mark.parametrize("function", [saddle, ripples])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
@pytest.mark.parametrize("size", [(300, 170), (1, 1), (65, 64), (3, 200)])
def test_values_are_right_everywhere(
    function: object, tolerance: float, size: tuple[int, int]
) -> None:
    assert callable(function)
    grid = plane(*size)
    found = everywhere(lattice(grid, function, tolerance))
    expected = function(pixels(grid)).T.reshape(found.shape)
    # Halfway between nodes, where they are looked at, errors of smooth functions are largest.
    assert np.abs(found - expected).max() < 1.1 * tolerance


def test_straight_functions_are_asked_at_few_places() -> None:
    asked = []

    def straight(xy: np.ndarray) -> np.ndarray:
        asked.append(len(xy))
        return xy @ [[1, 2], [-3, 4]]

    grid = Grid(Affine(0.5, 0, 1000, 0, -0.5, 2000), None, 512, 512)
    found = everywhere(lattice(grid, straight, 1e-6))
    np.testing.assert_allclose(found.reshape(2, -1).T, straight(pixels(grid)), rtol=1e-12)
    assert len(asked) == 2 and asked[0] < 400


@pytest.mark.parametrize("edge", [40.0, 99.5, -1.0])
def test_what_is_not_known_spoils_nothing_else(edge: float) -> None:
    grid = plane(100, 80)
    nodes = lattice(grid, lambda xy: np.where(xy[:, :1] < edge, xy, np.nan), 1e-3)
    found = everywhere(nodes)
    known = pixels(grid)[:, 0].reshape(80, 100) < edge
    np.testing.assert_array_equal(np.isfinite(found[0]), known)
    np.testing.assert_allclose(found[:, known].T, pixels(grid)[known.ravel()])


def test_single_precision_serves_for_what_is_left() -> None:
    grid = plane(300, 200)
    nodes = lattice(grid, lambda xy: xy + 4e6, 1e-3)
    left = nodes.minus(np.array([4e6, 4e6]))
    assert left.lines(slice(0, 20)).dtype == np.float32
    np.testing.assert_allclose(everywhere(left).reshape(2, -1).T, pixels(grid), atol=1e-4)


@settings(max_examples=30)
@given(st.integers(1, 200), st.integers(1, 200), st.integers(0, 10))
def test_bounds_are_those_of_the_pixels(width: int, height: int, seed: int) -> None:
    a, b, c = np.random.default_rng(seed).normal(size=3)

    def bilinear(xy: np.ndarray) -> np.ndarray:
        return (a * xy[:, :1] + b * xy[:, 1:]) + c * xy[:, :1] * xy[:, 1:] / 100

    nodes = lattice(plane(width, height), bilinear, 1e-3)
    found = everywhere(nodes)
    np.testing.assert_allclose(nodes.bounds().ravel(), [found.min(), found.max()], atol=1e-9)


@pytest.mark.parametrize("size", [(1, 1), (7, 100_000), (100_000, 7), (512, 512)])
def test_strips_make_up_the_grid(size: tuple[int, int]) -> None:
    rows = [row for part in row_strips(size[1], size[0]) for row in range(size[1])[part]]
    assert rows == list(range(size[1]))
