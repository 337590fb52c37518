"""What the tool `register` leaves beside the registered image."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster
from rpc_models import camera_rpc, to_rasterio
from rpc_scenes import SIZE, Scene, make_scene
from textured_pairs import TexturedPair, texture

import groundtie
from groundtie.errors import NotRegisteredError, OutputError, ParameterError
from groundtie.registration import automatic
from groundtie.registration.registration import Registration
from groundtie.sensor.bias import Bias


@pytest.mark.slow
def test_the_displacement_is_written(textured: TexturedPair, tmp_path: Path) -> None:
    path = tmp_path / "moved.tif"
    groundtie.register(textured.reference, textured.input, displacement=path)
    with rasterio.open(path) as raster:
        dx, dy, sigma = raster.read()
        assert raster.units == ("m", "m", "m")
    known = np.isfinite(dx)
    assert known.mean() > 0.5
    # The input claims to lie 70 m too far east and 45 m too far south; pixels have 10 m.
    error = np.array([dx[known] + 70, dy[known] - 45])
    assert np.abs(error).max() < 1.5
    assert (sigma[known] > 0).all()


@pytest.mark.parametrize("name", ["transform", "displacement"])
def test_an_image_with_rpcs_has_none_to_write(
    textured: TexturedPair, tmp_path: Path, name: str
) -> None:
    image = write_raster(tmp_path / "image.tif", np.ones((50, 60), np.uint8))
    with rasterio.open(image, "r+") as dataset:
        dataset.rpcs = to_rasterio(camera_rpc((60, 50)))
    suffix = ".json" if name == "transform" else ".tif"
    with pytest.raises(ParameterError, match=f"there is no {name} to write"):
        groundtie.register(
            textured.reference,
            image,
            tmp_path / "out.tif",
            **{name: tmp_path / f"other{suffix}"},
        )
    assert not (tmp_path / "out.tif").exists()


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    bias = Bias("shift", SIZE, np.array([[9.0, -7.0]]), np.zeros((2, 2)))
    return make_scene(tmp_path_factory.mktemp("scene"), bias)


@pytest.mark.slow
def test_an_image_with_rpcs_is_registered_as_its_two_steps_are(
    scene: Scene, tmp_path: Path
) -> None:
    heights: Any = {"dem": scene.dem, "dem_datum": "ellipsoidal"}
    files: Any = {"tie_points": tmp_path / "points.csv", "report": tmp_path / "report.html"}
    result = groundtie.register(
        scene.reference, scene.image, tmp_path / "at_once.tif", **heights, **files
    )
    assert result.files == {
        name: str(path)
        for name, path in {"output": tmp_path / "at_once.tif", **files}.items()
        if name != "tie_points"
    } | {"residuals": str(files["tie_points"])}
    # What was asked for, and nothing of how it was done.
    given = json.loads((tmp_path / "report.json").read_text())["parameters"]
    assert given["input"] == str(scene.image) and given["output"] == str(tmp_path / "at_once.tif")
    assert {"image", "rpc", "residuals", "image_band"}.isdisjoint(given)
    rpcs = tmp_path / "refined_RPC.TXT"
    groundtie.refine_rpc(scene.image, rpcs, scene.reference, **heights)
    groundtie.orthorectify(
        scene.image, tmp_path / "steps.tif", rpc=rpcs, crs="EPSG:32632", **heights
    )
    with (
        rasterio.open(tmp_path / "at_once.tif") as found,
        rasterio.open(tmp_path / "steps.tif") as expected,
    ):
        assert found.transform == expected.transform
        np.testing.assert_array_equal(found.read(), expected.read())


@pytest.mark.slow
def test_an_image_with_rpcs_leaves_all_files_or_none(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:

    def full(_: Any, path: Path, *__: Any) -> None:
        path.write_bytes(b"part")
        raise OutputError("no space left")

    monkeypatch.setattr(automatic, "write_orthoimage", full)
    with pytest.raises(OutputError, match="no space left"):
        groundtie.register(
            scene.reference,
            scene.image,
            tmp_path / "registered.tif",
            dem=scene.dem,
            dem_datum="ellipsoidal",
            tie_points=tmp_path / "points.csv",
            report=tmp_path / "report.html",
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_what_matches_at_two_places_is_not_tried_in_another_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same ground every 51 pixels: a search of rotations would find one of the places."""
    tried: list[str] = []

    def run(*arguments: Any) -> Registration:
        found = automatic_run(*arguments)
        tried.append(found.verdict.rule)
        return found

    automatic_run = automatic.run
    monkeypatch.setattr(automatic, "run", run)
    ground = np.tile(texture(51, 51), (9, 9))
    paths = []
    for name, first in (("reference.tif", 20), ("input.tif", 30)):
        noise = np.random.default_rng(first).normal(size=(400, 400))
        view = ground[first : first + 400, first : first + 400] + 0.2 * noise
        image = np.clip(120 + 30 * view, 1, 255).astype(np.float32)
        paths.append(write_raster(tmp_path / name, image, utm_grid(400, 400, 1.0)))
    with pytest.raises(NotRegisteredError, match="two places match about as well"):
        groundtie.register(*paths)
    assert tried == ["second place"]


@pytest.mark.slow
def test_what_the_images_are_is_asked_as_far_as_each_way_searches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mask of the ground is made of what a radar image shows there, and nothing beyond."""
    searched = []

    def run(*arguments: Any) -> Registration:
        found = automatic_run(*arguments)
        grid = found.scene.reference.scene.grid
        assert grid == found.scene.input.scene.grid == found.pair.surroundings
        searched.append((grid.width, found.scene))
        return found

    automatic_run = automatic.run
    monkeypatch.setattr(automatic, "run", run)
    # Of another place each; the input is in the middle of the reference.
    paths = []
    for seed, (name, first, side) in enumerate(
        (("reference.tif", 0, 700), ("input.tif", 250, 200))
    ):
        image = np.clip(120 + 30 * texture(side, side, seed=seed), 1, 255).astype(np.float32)
        place = utm_grid(700, 700, 1.0).window(first, first, side, side)
        paths.append(write_raster(tmp_path / name, image, place))
    with pytest.raises(NotRegisteredError):
        groundtie.register(*paths)
    widths, scenes = zip(*searched, strict=True)
    assert widths[-1] > widths[0]
    assert scenes[0] is scenes[1]
