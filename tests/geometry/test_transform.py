from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.errors import ParameterError, TransformFileError
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import KINDS
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform, load_transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, reproject

GRID = utm_grid(400, 300)
DEGREES = Grid(Affine(1e-4, 0, 9.0, 0, -1e-4, 45.15), CRS.from_epsg(4326), 400, 300)
PLAIN = Grid(PIXEL_COORDINATES, None, 400, 300)


def misregistered(kind: str, crs: CRS | None, grid: Grid) -> Transform:
    rng = np.random.default_rng(0)
    px = rng.uniform(0, 300, (40, 2))
    nominal = Transform.nominal(crs, grid).nominal_xy(px)
    centre, size = nominal.mean(axis=0), np.ptp(nominal, axis=0).max()
    shift = 0.02 * size * np.sin((nominal - centre) / size + [0.3, 1.0])
    return Transform(fit_model(kind, nominal - shift, nominal), crs, grid)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("crs", "grid"), [(UTM, GRID), (UTM, DEGREES), (None, PLAIN)])
@settings(max_examples=10)
@given(px=st.lists(st.tuples(st.floats(0, 400), st.floats(0, 300)), min_size=1, max_size=5))
def test_pixels_to_the_map_and_back(
    kind: str, crs: CRS | None, grid: Grid, px: list[tuple[float, float]]
) -> None:
    transform = misregistered(kind, crs, grid)
    np.testing.assert_allclose(transform(transform.inverse(px)), px, atol=1e-4)


def test_a_shift_moves_the_pixels_by_it() -> None:
    """Ground at x whose nominal place is x + (20, -30) m is 2 columns and 3 rows on."""
    xy = GRID.pixel_to_map([[10, 10], [50, 70], [200, 30]])
    transform = Transform(fit_model("translation", xy, xy + [20, -30]), UTM, GRID)
    np.testing.assert_allclose(transform(xy), [[12, 13], [52, 73], [202, 33]], atol=1e-6)


@pytest.mark.parametrize("kind", ["affine", "tps"])
def test_positions_come_in_arrays_of_any_shape(kind: str) -> None:
    transform = misregistered(kind, UTM, DEGREES)
    px = np.random.default_rng(1).uniform(0, 300, (4, 5, 2))
    for function, positions in (
        (transform, transform.nominal_xy(px)),
        (transform.inverse, px),
        (transform.nominal_xy, px),
    ):
        found = function(positions)
        assert found.shape == (4, 5, 2)
        np.testing.assert_array_equal(found.reshape(-1, 2), function(positions.reshape(-1, 2)))
        np.testing.assert_allclose(function(list(positions[1, 2])), found[1, 2], rtol=1e-9)
        assert function(positions[:0]).shape == (0, 5, 2)


@pytest.mark.parametrize("shape", [(2, 4), (2, 3), (4,), (5, 3), ()])
def test_positions_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    """Of (2, 4), all x before all y, other positions would be made."""
    transform = misregistered("affine", UTM, GRID)
    for function in (transform, transform.inverse, transform.nominal_xy):
        with pytest.raises(ParameterError, match=r"must have the shape \(\.\.\., 2\), not "):
            function(np.ones(shape))


def test_an_input_across_the_antimeridian_is_one() -> None:
    """Longitudes from 179.99° to 180.01°; beyond 180° PROJ has -180°."""
    grid = Grid(Affine(1e-5, 0, 179.99, 0, -1e-5, -17.0), CRS.from_epsg(4326), 2000, 400)
    transform = Transform.nominal(CRS.from_epsg(32701), grid)
    px = grid.places()
    np.testing.assert_allclose(transform(transform.inverse(px)), px, atol=1e-3)


class TestReferenceAcrossTheAntimeridian:
    """Its map goes on beyond 180°, or beyond -180°; of UTM zone 1, PROJ has longitudes in ±180°."""

    UTM1 = Grid(Affine(10, 0, 177_000, 0, -10, 8_118_000), CRS.from_epsg(32701), 800, 400)

    def transform(self, turn: float) -> tuple[Transform, np.ndarray, np.ndarray]:
        """Return one fitted to points on both sides, and their positions and pixels."""
        xy = np.random.default_rng(0).uniform([-0.02, -17.02], [0.02, -16.98], (40, 2))
        xy += [turn, 0]
        nominal = xy + [2e-4, -1e-4] + 0.01 * (xy - [turn, -17.0])
        lon = np.where(np.abs(nominal) > 180, nominal - 2 * turn, nominal)[:, 0]
        px = self.UTM1.map_to_pixel(
            reproject(np.column_stack([lon, nominal[:, 1]]), DEGREES.crs, self.UTM1.crs)
        )
        return Transform(fit_model("affine", xy, nominal), DEGREES.crs, self.UTM1), xy, px

    @pytest.mark.parametrize("turn", [180.0, -180.0])
    def test_pixels_are_where_the_reference_has_them(self, turn: float) -> None:
        transform, xy, px = self.transform(turn)
        np.testing.assert_allclose(transform(xy), px, atol=1e-3)
        np.testing.assert_allclose(transform.inverse(px), xy, atol=1e-8)

    @pytest.mark.parametrize("kind", ["affine", "polynomial2"])
    def test_positions_may_count_longitudes_the_other_way(self, kind: str) -> None:
        fitted, xy, px = self.transform(180.0)
        transform = replace(fitted, model=fit_model(kind, xy, fitted.model(xy)))
        np.testing.assert_allclose(transform(xy - [360, 0]), px, atol=1e-3)

    def test_positions_of_other_maps_are_taken_there(self) -> None:
        transform, xy, px = self.transform(180.0)
        in_metres = reproject(xy, DEGREES.crs, self.UTM1.crs)
        np.testing.assert_allclose(transform.of_map(self.UTM1.crs)(in_metres), px, atol=1e-3)

    @pytest.mark.parametrize("turn", [180.0, -180.0])
    def test_points_have_no_residuals_of_a_turn(self, turn: float) -> None:
        transform, xy, px = self.transform(turn)
        points = TiePoints.unmeasured(xy, px, None)
        grid = Grid(Affine(1e-4, 0, turn - 0.03, 0, -1e-4, -16.97), DEGREES.crs, 600, 600)
        assert np.abs(points.residual_on(grid, transform)).max() < 1e-3

    def test_an_input_of_the_whole_earth_has_its_own_longitudes(self) -> None:
        grid = Grid(Affine(1, 0, -180, 0, -1, 90), DEGREES.crs, 360, 180)
        xy = np.random.default_rng(0).uniform(20, 40, (20, 2))
        transform = Transform(fit_model("translation", xy, xy + [1, 0]), DEGREES.crs, grid)
        np.testing.assert_allclose(transform.inverse([[2, 90]]), [[-178.5, -0.5]], atol=1e-6)


def test_nominal_is_the_georeferencing() -> None:
    transform = Transform.nominal(UTM, DEGREES)
    px = np.array([[0.0, 0.0], [399.0, 299.0]])
    lonlat = DEGREES.pixel_to_map(px)
    np.testing.assert_allclose(transform(reproject(lonlat, DEGREES.crs, UTM)), px, atol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("crs", "grid"), [(UTM, GRID), (UTM, DEGREES), (None, PLAIN)])
def test_to_a_file_and_back(tmp_path: Path, kind: str, crs: CRS | None, grid: Grid) -> None:
    transform = misregistered(kind, crs, grid)
    path = tmp_path / "transform.json"
    path.write_text(json.dumps(transform.to_json()))
    again = load_transform(path)
    assert again.crs == crs
    assert again.input_grid == grid
    xy = transform.inverse([[5, 6], [300, 200]])
    np.testing.assert_array_equal(again(xy), transform(xy))
    assert load_transform(str(path)).model.kind == kind


def test_transforms_and_models_are_compared_and_kept_in_sets_by_identity() -> None:
    one, other = (misregistered("affine", UTM, GRID) for _ in range(2))
    assert one == one and one != other
    assert {one, other, one} == {other, one}
    assert one.model != other.model


@pytest.mark.parametrize("path", [None, {}])
def test_a_transform_is_read_from_a_file(path: object) -> None:
    with pytest.raises(TransformFileError, match="is read from a file"):
        load_transform(path)  # type: ignore[arg-type]


def damaged(**changes: object) -> str:
    return json.dumps(Transform.nominal(UTM, GRID).to_json() | changes)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "{}",
        "null",
        damaged(format="groundtie-transform/99"),
        damaged(model={"kind": "affine"}),
        damaged(model=None),
        damaged(crs="EPSG:no"),
        damaged(input={"crs": None, "geotransform": [1, 2], "width": 3, "height": 4}),
        "\xff\xfe",
    ],
)
def test_other_files_are_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(TransformFileError, match=r"bad\.json"):
        load_transform(path)


def test_another_encoding_is_named(tmp_path: Path) -> None:
    (tmp_path / "t.json").write_text("{}", encoding="utf-16")
    with pytest.raises(TransformFileError, match=r"t\.json: it is no UTF-8 text"):
        load_transform(tmp_path / "t.json")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(TransformFileError, match=r"missing\.json"):
        load_transform(tmp_path / "missing.json")
