from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import rasterio

from groundtie.errors import OutputError
from groundtie.geometry.transform import load_transform
from groundtie.geometry.views import View
from groundtie.simulation.files import CHECK_POINT_COLUMNS, ROOF_POINT_COLUMNS, write_pair
from groundtie.simulation.misregistration import DISTORTIONS, DistortionOptions
from groundtie.simulation.optical import OpticalOptions
from groundtie.simulation.pair import PairOptions, SimulatedPair, simulate_pair
from groundtie.simulation.scene import SceneOptions


def simulated(kind: str = "affine", input_pixel_size_m: float | None = 1.25) -> SimulatedPair:
    return simulate_pair(
        PairOptions(
            scene=SceneOptions((120, 100), seed=6),
            optical=OpticalOptions(bands=("red", "nir")),
            distortion=DistortionOptions(kind, 3.0),
            input_pixel_size_m=input_pixel_size_m,
        )
    )


@pytest.fixture(scope="module")
def pair() -> SimulatedPair:
    return simulated()


@pytest.fixture(scope="module")
def paths(pair: SimulatedPair, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return write_pair(pair, tmp_path_factory.mktemp("pair") / "new" / "folder")


def check_points(path: Path) -> np.ndarray:
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    assert tuple(rows[0]) == CHECK_POINT_COLUMNS
    return np.array(rows[1:], float)


class TestRasters:
    def test_reference(self, pair: SimulatedPair, paths: dict[str, Path]) -> None:
        with rasterio.open(paths["reference"]) as raster:
            assert np.array_equal(raster.read(), pair.reference)
            assert raster.transform == pair.reference_grid.transform
            assert raster.crs == pair.reference_grid.crs
            assert raster.descriptions == ("Amplitude",)

    def test_surface(self, pair: SimulatedPair, paths: dict[str, Path]) -> None:
        with rasterio.open(paths["dsm"]) as raster, rasterio.open(paths["dem"]) as ground:
            surface, terrain, margin = raster.read(1), ground.read(1), pair.scene.margin_px
            corner = pair.reference_grid.pixel_to_map([[-margin, -margin]])[0]
            assert raster.xy(0, 0) == pytest.approx(tuple(corner))
        rows, cols = pair.scene.window
        above = surface[rows, cols] - terrain
        stands = pair.scene.object_m[rows, cols] > 2
        np.testing.assert_allclose(
            above[stands], pair.scene.object_m[rows, cols][stands], atol=1e-3
        )
        assert stands.any() and (above >= 0).all()

    def test_views(self, pair: SimulatedPair, paths: dict[str, Path]) -> None:
        options = pair.options
        radar, camera = (View.of(paths[name], None) for name in ("reference", "input"))
        assert radar == View("radar", 270.0, options.sar.incidence_deg)
        assert camera == View(
            "camera",
            options.optical.view_azimuth_deg,
            options.optical.off_nadir_deg,
            options.optical.sun_azimuth_deg,
            options.optical.sun_elevation_deg,
        )

    def test_input(self, pair: SimulatedPair, paths: dict[str, Path]) -> None:
        with rasterio.open(paths["input"]) as raster:
            assert np.array_equal(raster.read(), pair.input)
            assert raster.transform == pair.truth.input_grid.transform
            assert raster.res == (1.25, 1.25)
            assert raster.descriptions == ("Red", "Nir")

    def test_dem_is_the_bare_ground(self, pair: SimulatedPair, paths: dict[str, Path]) -> None:
        with rasterio.open(paths["dem"]) as raster:
            assert raster.dtypes == ("float32",)
            assert np.array_equal(raster.read(1), pair.scene.terrain_m[pair.scene.window])
            assert raster.transform == pair.reference_grid.transform

    def test_are_tiled_and_compressed(self, paths: dict[str, Path]) -> None:
        for name in ("reference", "input", "dem"):
            with rasterio.open(paths[name]) as raster:
                assert raster.profile["tiled"]
                assert raster.profile["compress"] == "deflate"


class TestTruth:
    @pytest.mark.parametrize("kind", list(DISTORTIONS))
    @pytest.mark.slow
    def test_loads_as_a_transform_that_agrees(self, kind: str, tmp_path: Path) -> None:
        pair = simulated(kind)
        truth = load_transform(write_pair(pair, tmp_path)["truth"])
        xy = pair.reference_grid.pixel_to_map([[0, 0], [60, 50], [119, 99], [-300, 700]])
        np.testing.assert_allclose(truth(xy), pair.truth(xy), atol=1e-9)

    @pytest.mark.parametrize("kind", ["shift", "rotation", "scale", "similarity", "affine"])
    @pytest.mark.slow
    def test_matrices_agree_with_it(self, kind: str, tmp_path: Path) -> None:
        pair = simulated(kind)
        values = json.loads(write_pair(pair, tmp_path)["truth"].read_text(encoding="utf-8"))
        px = np.array([[0, 0, 1], [119, 0, 1], [37.5, 99, 1]])
        xy = pair.reference_grid.pixel_to_map(px[:, :2])
        expected = pair.truth(xy)
        found = px @ np.array(values["reference_to_input"]).T
        np.testing.assert_allclose(found, expected, atol=1e-5)
        found = np.column_stack([xy, np.ones(3)]) @ np.array(values["map_to_input"]).T
        np.testing.assert_allclose(found, expected, atol=1e-4)

    def test_of_a_polynomial_has_no_matrix(self, tmp_path: Path) -> None:
        values = json.loads(write_pair(simulated("polynomial"), tmp_path)["truth"].read_text())
        assert "reference_to_input" not in values
        assert values["model"]["kind"] == "polynomial3"
        assert np.shape(values["model"]["coefficients"]) == (10, 2)

    def test_tells_what_it_was_drawn_from(self, paths: dict[str, Path]) -> None:
        values = json.loads(paths["truth"].read_text(encoding="utf-8"))
        assert values["seed"] == 6
        assert values["sigma_px"] == 0
        assert values["options"]["distortion"]["kind"] == "affine"
        assert values["options"]["scene"]["size_px"] == [120, 100]


class TestCheckPoints:
    def test_agree_with_the_truth(self, pair: SimulatedPair, paths: dict[str, Path]) -> None:
        table = check_points(paths["check_points"])
        assert len(table) == len(pair.check_points_px) > 20
        np.testing.assert_allclose(pair.truth(table[:, :2]), table[:, 4:], atol=1e-5)
        np.testing.assert_allclose(
            pair.reference_grid.pixel_to_map(table[:, 2:4]), table[:, :2], atol=1e-5
        )


class TestRoofPoints:
    def test_are_those_of_the_pair(self, tmp_path: Path) -> None:
        options = PairOptions(scene=SceneOptions((200, 200), density="urban", seed=2))
        made = simulate_pair(options)
        with write_pair(made, tmp_path)["roof_points"].open(newline="", encoding="utf-8") as stream:
            rows = list(csv.reader(stream))
        assert tuple(rows[0]) == ROOF_POINT_COLUMNS
        table = np.array(rows[1:], float)
        assert len(table) == len(made.roof_points.px) > 10
        for columns, expected in (
            (slice(0, 2), made.reference_grid.pixel_to_map(made.roof_points.px)),
            (2, made.roof_points.height_m),
            (slice(3, 5), made.roof_points.reference_px),
            (slice(5, 7), made.roof_points.input_px),
        ):
            np.testing.assert_allclose(table[:, columns], expected, atol=1e-5)

    def test_of_a_place_without_roofs_are_none(self, tmp_path: Path) -> None:
        made = simulate_pair(PairOptions(scene=SceneOptions((96, 96), density="rural")))
        lines = write_pair(made, tmp_path)["roof_points"].read_text().splitlines()
        assert lines == [",".join(ROOF_POINT_COLUMNS)]


class TestWholeOrNothing:
    def test_writes_these_files_and_no_others(self, paths: dict[str, Path]) -> None:
        written = {path.name for path in paths["truth"].parent.iterdir()}
        assert written == {path.name for path in paths.values()}

    def test_replaces_an_older_pair(self, pair: SimulatedPair, tmp_path: Path) -> None:
        write_pair(simulated("shift"), tmp_path)
        paths = write_pair(pair, tmp_path)
        assert load_transform(paths["truth"]).model.kind == "affine"

    def test_folder_that_is_a_file(self, pair: SimulatedPair, tmp_path: Path) -> None:
        (tmp_path / "taken").write_text("here")
        with pytest.raises(OutputError, match="taken"):
            write_pair(pair, tmp_path / "taken")

    def test_leaves_nothing_behind_when_one_file_cannot_be_written(
        self, pair: SimulatedPair, tmp_path: Path
    ) -> None:
        (tmp_path / "truth.json").mkdir()
        with pytest.raises(OutputError):
            write_pair(pair, tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["truth.json"]
