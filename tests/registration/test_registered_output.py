from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import UTM, utm_grid, wave_image, write_raster
from rasterio import warp
from rasterio.crs import CRS
from rasterio.enums import Resampling
from textured_pairs import TexturedPair, pixels, shift_on_map

from groundtie.context import Context
from groundtie.errors import ParameterError
from groundtie.geometry.models import KINDS, Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, reproject
from groundtie.rasters.reading import open_raster
from groundtie.registration.registered_output import (
    OUTPUT_GRIDS,
    BeyondOverlap,
    RegisteredOutput,
    model_for_grid,
    moved_grid,
)

GRID = utm_grid(200, 150)


def test_untouched_pixels_allow_a_shift_only() -> None:
    for grid in ("reference", "input"):
        for model in ("auto", *KINDS):
            assert model_for_grid(model, grid) == model
    assert model_for_grid("auto", "untouched") == "translation"
    assert model_for_grid("translation", "untouched") == "translation"
    for model in set(KINDS) - {"translation"}:
        with pytest.raises(ParameterError, match=f"not {model}"):
            model_for_grid(model, "untouched")


def test_the_moved_grid_puts_every_pixel_where_the_transform_does() -> None:
    transform = Transform(shift_on_map(37.0, -12.5), UTM, GRID)
    moved = moved_grid(transform)
    px = GRID.outline(5)
    np.testing.assert_allclose(moved.pixel_to_map(px), transform.inverse(px), atol=1e-6)
    assert moved == GRID.shifted(-37.0, 12.5)


def test_a_shift_in_another_crs_that_is_one_there_too() -> None:
    """Within a small scene, a shift in UTM is a shift in degrees to a twentieth of a pixel."""
    degrees = Grid(Affine(1e-4, 0, 9.0, 0, -1e-4, 45.1), CRS.from_epsg(4326), 100, 100)
    transform = Transform(shift_on_map(50.0, 20.0), UTM, degrees)
    moved = moved_grid(transform)
    px = degrees.outline(3)
    expected = reproject(transform.inverse(px), UTM, degrees.crs)
    np.testing.assert_allclose(moved.pixel_to_map(px), expected, atol=5e-6)


def test_a_shift_that_is_none_in_the_inputs_crs_is_an_error() -> None:
    """Over a whole degree, a hundred kilometres east are not equally many degrees everywhere."""
    wide = Grid(Affine(0.01, 0, 8.0, 0, -0.01, 50.0), CRS.from_epsg(4326), 300, 300)
    with pytest.raises(ParameterError, match="pixels cannot stay untouched"):
        moved_grid(Transform(shift_on_map(1e5, 0.0), UTM, wide))


def test_a_rotation_is_no_shift() -> None:
    frame = Frame.around(GRID.pixel_to_map(GRID.outline()))
    turn = PolynomialModel("rigid", frame, np.array([[0, 0], [0, 0.02], [-0.02, 0]]))
    with pytest.raises(ParameterError):
        moved_grid(Transform(turn, UTM, GRID))


def test_images_without_georeferencing_move_in_pixels() -> None:
    plain = Grid(PIXEL_COORDINATES, None, 50, 40)
    moved = moved_grid(Transform(shift_on_map(3.0, -2.0), None, plain))
    np.testing.assert_allclose(moved.pixel_to_map([[0, 0]]), [[-3, 2]])


@pytest.mark.parametrize("grid", OUTPUT_GRIDS)
def test_ground_lies_where_the_truth_has_it_on_every_grid(
    textured: TexturedPair, tmp_path: Path, context: Context, grid: str
) -> None:
    output = RegisteredOutput(tmp_path / "out.tif", grid, "cubic")
    with textured.opened() as pair, Outputs() as outputs:
        source, reference = pair.input.source, pair.reference.source.grid
        output.write(source, reference, textured.truth, outputs, context)
    with rasterio.open(output.path) as out, rasterio.open(textured.reference) as reference:
        assert out.crs == reference.crs
        # Both show the same ground: the textures are inverted, up to their noise.
        near = Grid(out.transform, out.crs, out.width, out.height)
    px = np.stack(np.meshgrid(np.arange(40, 200, 3), np.arange(40, 180, 3)), -1).reshape(-1, 2)
    there = np.rint(near.map_to_pixel(textured.grid.pixel_to_map(px))).astype(int)
    shown = pixels(output.path)[0][there[:, 1], there[:, 0]].astype(float)
    expected = textured.reference_values[px[:, 1], px[:, 0]].astype(float)
    # Rounding to the untouched grid costs some correlation: up to half a pixel.
    assert np.corrcoef(shown, expected)[0, 1] < -0.8


def test_the_rows_of_a_grid_are_moved_and_no_pixel_changed(
    textured: TexturedPair, tmp_path: Path, one_thread: Context
) -> None:
    output = RegisteredOutput(tmp_path / "out.tif", "untouched", "cubic")
    with textured.opened() as pair, Outputs() as outputs:
        source, reference = pair.input.source, pair.reference.source.grid
        output.write(source, reference, textured.truth, outputs, one_thread)
    np.testing.assert_array_equal(pixels(output.path), pixels(textured.input))
    with rasterio.open(output.path) as out:
        expected = textured.truth.input_grid.shifted(-70.0, 45.0).transform
        assert out.transform.almost_equals(expected, 1e-6)


def test_a_reference_grid_in_another_crs_than_the_transform_shows_the_same_ground(
    tmp_path: Path, one_thread: Context
) -> None:
    zone_33 = CRS.from_epsg(32633)
    path = write_raster(tmp_path / "in.tif", wave_image(GRID, 600.0).astype(np.float32), GRID)
    left, top = reproject(GRID.pixel_to_map([GRID.centre_px]), UTM, zone_33)[0] + [-500, 400]
    target = Grid(Affine(10, 0, left, 0, -10, top), zone_33, 100, 80)
    expected = np.empty((80, 100), np.float32)
    warp.reproject(
        pixels(path)[0], expected, src_transform=GRID.transform, src_crs=UTM,
        dst_transform=target.transform, dst_crs=zone_33, resampling=Resampling.cubic,
    )  # fmt: skip
    output = RegisteredOutput(tmp_path / "out.tif", "reference", "cubic")
    with open_raster(path) as source, Outputs() as outputs:
        output.write(source, target, Transform.nominal(UTM, GRID), outputs, one_thread)
    # With waves of sixty pixels, GDAL's approximation of positions costs an eighth of a pixel.
    np.testing.assert_allclose(pixels(output.path)[0], expected, atol=0.5)


@pytest.mark.parametrize(
    ("overlap", "share"),
    [
        (GRID.window(-50, -50, 400, 400), 0.0),
        (GRID.window(4, 3, 100, 75), 0.75),
        (GRID.window(4 + 150, 3, 100, 150), 0.75),  # ends 50 px beyond the input
        (GRID.window(900, 0, 100, 100), 1.0),
    ],
)
def test_what_lies_outside_of_the_overlap(overlap: Grid, share: float) -> None:
    """The input is moved by 4 px to the right and 3 px down, to its place."""
    transform = Transform(shift_on_map(-40.0, 30.0), UTM, GRID)
    assert BeyondOverlap.of("reference", transform, overlap.covers) is None
    beyond = BeyondOverlap.of("input", transform, overlap.covers)
    if beyond is None:
        assert share == 0
        return
    assert beyond.share == pytest.approx(share, abs=0.02)
    assert not beyond.bends
    assert "warning" not in beyond.line()


def test_the_share_outside_of_the_overlap_is_that_of_the_area() -> None:
    """Wherever a border lies: the mean over many is not biased."""
    transform = Transform(shift_on_map(0.0, 0.0), UTM, GRID)
    errors = []
    for px in np.arange(5.0, 45.0, 0.5):
        beyond = BeyondOverlap.of("input", transform, GRID.shifted(10 * px, 10 * px).covers)
        assert beyond is not None
        errors.append(beyond.share - (1 - (1 - px / 200) * (1 - px / 150)))
    assert np.mean(errors) == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_models_that_bend_are_warned_of(kind: str) -> None:
    beyond = BeyondOverlap(0.78, kind)
    assert "78 % of the registered image" in beyond.line().replace("%", " %")
    bends = kind in ("polynomial2", "polynomial3", "tps")
    assert beyond.summary() == {"share": 0.78, "model_bends": bends}
    assert (f"warning: {kind} bends" in beyond.line()) == bends


def test_positions_that_nothing_leads_to_lie_outside() -> None:
    transform = Transform(shift_on_map(math.nan, 0.0), UTM, GRID)
    beyond = BeyondOverlap.of("input", transform, GRID.covers)
    assert beyond is not None and beyond.share == 1
