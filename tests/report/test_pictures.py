"""Pictures show the images and surfaces that they were made from, and stay small."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from affine import Affine
from html_pages import decoded, picture_of
from raster_files import utm_grid
from rasterio.crs import CRS

from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import Frame
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid, mesh
from groundtie.rasters.patch import Patch
from groundtie.report import pictures

GRID = utm_grid(300, 200, 2.0)


def test_overviews_keep_small_grids_and_shrink_large_ones() -> None:
    assert pictures.overview_grid(GRID) is GRID
    large = replace(GRID, width=5000, height=2000)
    small = pictures.overview_grid(large)
    assert (small.width, small.height) == (pictures.OVERVIEW_PX, pictures.OVERVIEW_PX * 2 // 5)
    corners = [[-0.5, -0.5], [4999.5, 1999.5]]
    np.testing.assert_allclose(
        small.pixel_to_map([[-0.5, -0.5], [small.width - 0.5, small.height - 0.5]]),
        large.pixel_to_map(corners),
    )


@pytest.mark.parametrize("kind", ["affine", "polynomial3", "tps"])
def test_the_stand_in_for_a_transform_is_as_good_as_it(kind: str) -> None:
    grid = replace(GRID, width=800, height=600)
    cols, rows = np.meshgrid(np.linspace(20, 780, 10), np.linspace(20, 580, 10))
    xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    moved = xy + np.random.default_rng(0).normal(0, 6, xy.shape)
    model = fit_model(kind, xy, moved, np.ones(len(xy)), Frame.around(xy))
    transform = Transform(model, GRID.crs, grid)
    stand_in = pictures.overview_positions(transform, grid)
    at = grid.pixel_to_map(np.random.default_rng(1).uniform([0, 0], [799, 599], (500, 2)))
    assert np.abs(stand_in(at) - transform(at)).max() < 0.25


def test_a_transform_that_ends_within_the_grid_has_no_stand_in() -> None:
    def half(xy: np.ndarray) -> np.ndarray:
        return np.where(xy[:, :1] > 500_300, np.inf, xy)

    assert pictures.overview_positions(half, GRID) is half


def test_an_overview_across_the_end_of_the_whole_earth() -> None:
    """A spline through the jump from its last column to its first was off by all of it."""
    grid, other = (
        Grid(Affine(0.5, 0, west, 0, -0.5, 90), CRS.from_epsg(4326), 720, 360)
        for west in (0.0, -180.0)
    )
    transform = Transform.nominal(grid.crs, other)
    places = grid.pixel_to_map(mesh(np.arange(720), [0, 180, 359]))
    found = pictures.overview_positions(transform, grid)(places)
    np.testing.assert_allclose(found, transform(places), atol=0.1)


def test_contrast_is_stretched_between_the_2nd_and_98th_percentile() -> None:
    values = np.arange(101, dtype=np.float32).reshape(1, 101)
    picture = pictures.grey_picture(Patch(values, np.ones((1, 101), bool)))
    assert picture[0, [0, 2, 98, 100]].tolist() == [0, 0, 255, 255]
    assert abs(int(picture[0, 50]) - 127) <= 1


def test_what_is_masked_does_not_count_and_is_light_grey() -> None:
    values = np.array([[0, 1, 2, 1e9]], np.float32)
    picture = pictures.grey_picture(Patch(values, np.array([[True, True, True, False]])))
    assert picture[0].tolist() == [0, 127, 255, 226]


@pytest.mark.parametrize("valid", [True, False])
def test_flat_and_empty_patches_become_pictures(valid: bool) -> None:
    picture = pictures.grey_picture(Patch(np.full((4, 5), 7, np.float32), np.full((4, 5), valid)))
    assert np.unique(picture).tolist() == [127 if valid else 226]


def test_the_backdrop_is_small_and_faint() -> None:
    picture = np.zeros((500, 1000), np.uint8)
    picture[:, 500:] = 255
    faint = pictures.backdrop(picture)
    assert faint.shape == (300, 600)
    assert (int(faint.min()), int(faint.max())) == (153, 255)
    assert pictures.backdrop(picture[:1]).shape == (1, 600)
    assert pictures.backdrop(picture[:20, :30]).shape == (20, 30)


def test_jpegs_show_the_picture_and_have_a_largest_size() -> None:
    smooth = cv2.GaussianBlur(
        np.random.default_rng(0).integers(0, 256, (90, 120)).astype(np.uint8), (0, 0), 4
    )
    back = picture_of(pictures.jpeg_uri(smooth), "image/jpeg")
    assert np.abs(back.astype(float) - smooth).mean() < 2
    side = pictures.OVERVIEW_PX
    noise = np.random.default_rng(0).integers(0, 256, (side, side)).astype(np.uint8)
    assert len(decoded(pictures.jpeg_uri(noise), "image/jpeg")) <= pictures.LARGEST_JPEG_BYTES


def test_surfaces_are_one_pixel_a_shift_and_brightest_at_the_peak() -> None:
    surface = np.random.default_rng(0).normal(size=(17, 17)).astype(np.float32)
    surface[5, 12] = 9
    picture = picture_of(pictures.surface_uri(surface), "image/png")
    assert picture.shape == (17, 17, 3)
    # Yellow is where green and red are high.
    brightness = picture[..., 1:].astype(int).sum(axis=2)
    assert np.unravel_index(brightness.argmax(), brightness.shape) == (5, 12)


def test_a_flat_surface_can_be_shown() -> None:
    assert picture_of(pictures.surface_uri(np.zeros((9, 9), np.float32)), "image/png").any()
