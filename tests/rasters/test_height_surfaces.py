from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from scipy.sparse import lil_matrix
from scipy.sparse.linalg import spsolve

from groundtie.rasters.height_surfaces import fill_voids, surface_around
from groundtie.rasters.reading import open_raster


def ramp(height: int, width: int) -> np.ndarray:
    rows, cols = np.mgrid[:height, :width]
    return (300 + 2.0 * cols - 1.5 * rows).astype(np.float32)


@pytest.mark.parametrize("shape", [(60, 80), (61, 47), (33, 128)])
@pytest.mark.parametrize("side", [1, 5, 20])
def test_a_slope_goes_on_through_a_void(shape: tuple[int, int], side: int) -> None:
    heights, valid = ramp(*shape), np.ones(shape, bool)
    valid[6 : 6 + side, 9 : 9 + side] = False
    filled = fill_voids(np.where(valid, heights, -9999).astype(np.float32), valid)
    assert np.abs(filled - heights).max() < 0.25
    np.testing.assert_array_equal(filled[valid], heights[valid])


def test_the_fill_is_the_membrane_of_laplaces_equation() -> None:
    rows, cols = np.mgrid[:40, :40]
    heights = (100 + 30 * np.sin(cols / 9) * np.cos(rows / 7)).astype(np.float32)
    valid = np.ones(heights.shape, bool)
    valid[12:24, 10:26] = False
    index = -np.ones(heights.shape, int)
    index[~valid] = np.arange((~valid).sum())
    system, known = lil_matrix((index.max() + 1,) * 2), np.zeros(index.max() + 1)
    for r, c in zip(*np.nonzero(~valid), strict=True):
        system[index[r, c], index[r, c]] = 4
        for i, j in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
            if valid[i, j]:
                known[index[r, c]] += heights[i, j]
            else:
                system[index[r, c], index[i, j]] = -1
    expected = spsolve(system.tocsr(), known)
    filled = fill_voids(heights, valid)
    assert np.abs(filled[~valid] - expected).max() < 1.0  # of 60 m of relief


def test_one_value_fills_all() -> None:
    valid = np.zeros((9, 14), bool)
    valid[3, 4] = True
    filled = fill_voids(np.full((9, 14), 7, np.float32), valid)
    np.testing.assert_allclose(filled, 7, rtol=1e-6)
    with pytest.raises(ValueError, match="nothing is valid"):
        fill_voids(np.zeros((4, 4), np.float32), np.zeros((4, 4), bool))


@pytest.mark.parametrize("void", [-9999.0, -32768.0])
@pytest.mark.parametrize("nodata", [None, "declared"])
def test_voids_of_large_regions_take_no_part_in_means(
    tmp_path: Path, void: float, nodata: str | None
) -> None:
    """Whether they are declared or not: a slope goes on through a disk of them."""
    size = 1300
    rows, cols = np.mgrid[:size, :size]
    slope = (300 + 0.2 * cols - 0.1 * rows).astype(np.float32)
    is_void = np.hypot(cols - 600, rows - 640) < 70.0
    heights = np.where(is_void, np.float32(void), slope)
    declared = {} if nodata is None else {"nodata": void}
    write_raster(tmp_path / "dem.tif", heights, utm_grid(size, size), **declared)
    with open_raster(tmp_path / "dem.tif") as dem:
        corners = np.array([[0.0, 0.0], [size - 1, size - 1]])
        surface = surface_around(dem, lambda px: px, corners)
        places = np.column_stack([cols[is_void], rows[is_void]]).astype(float)
        error = surface.at(places) - slope[is_void]
    assert surface.filled.shape == (512, 512)
    assert np.abs(error).max() < 1.0


@pytest.mark.parametrize("size", [300, 1300])
@pytest.mark.slow
def test_voids_that_are_open_to_the_edge_stay(tmp_path: Path, size: int) -> None:
    """What lies behind them is not known; those that valid pixels enclose are filled."""
    heights = ramp(size, size) / 10
    rows, cols = np.mgrid[:size, :size]
    is_open = cols > size // 2
    is_enclosed = np.hypot(cols - size / 4, rows - size / 2) < size / 10
    heights[is_open | is_enclosed] = -9999
    write_raster(tmp_path / "dem.tif", heights, utm_grid(size, size), nodata=-9999.0)
    corners = np.array([[0.0, 0.0], [size - 1, size - 1]])
    places = np.column_stack([cols.ravel(), rows.ravel()]).astype(float)
    with open_raster(tmp_path / "dem.tif") as dem:
        surface = surface_around(dem, lambda px: px, corners, fill_open=False)
        found = surface.at(places).reshape(size, size)
        measured = surface.is_measured(places).reshape(size, size)
        whole = surface_around(dem, lambda px: px, corners).at(places)
    near_rim = np.abs(cols - size // 2) < 4
    assert np.isnan(found[is_open & ~near_rim]).all()
    assert np.abs(found - ramp(size, size) / 10)[~is_open & ~near_rim].max() < 1.0
    assert np.isfinite(whole).all()
    assert measured.mean() == pytest.approx(1 - (is_open | is_enclosed).mean(), abs=0.01)


def test_what_has_no_place_on_the_terrain_model_is_not_enclosed(tmp_path: Path) -> None:
    grid = utm_grid(60, 40)
    path = write_raster(tmp_path / "dem.tif", ramp(40, 60), grid)
    places = np.array([[20.0, 10.0], [np.nan, np.nan], [np.inf, 3.0], [30.0, 30.0]])
    with open_raster(path) as dem:
        surface = surface_around(dem, lambda px: px, grid.outline())
        assert surface.encloses(places).tolist() == [True, False, False, True]
