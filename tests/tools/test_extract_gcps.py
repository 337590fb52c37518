from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from brightness_classifiers import bright_is_left_out
from raster_files import write_raster
from rasterio.crs import CRS
from rpc_models import to_rasterio
from rpc_scenes import SIZE, Scene, ground_texture, make_scene

import groundtie
from groundtie.errors import GroundTieError, NotRegisteredError
from groundtie.rasters.grid import Grid, apply_affine
from groundtie.rasters.reading import open_raster
from groundtie.sensor.bias import Bias

SHIFT = Bias("shift", SIZE, np.array([[31.0, -22.0]]), np.zeros((2, 2)))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return make_scene(tmp_path_factory.mktemp("scene"), SHIFT)


def call(scene: Scene, output: Path, **changes: object) -> groundtie.tools.extract_gcps.GcpResult:
    files = {"image": scene.image, "reference": scene.reference, "dem": scene.dem}
    more = {"dem_datum": "ellipsoidal", "output": output}
    return groundtie.extract_gcps(**(files | more | changes))  # type: ignore[arg-type]


@pytest.mark.slow
def test_points_lie_where_the_true_rpcs_see_them(scene: Scene, tmp_path: Path) -> None:
    result = call(scene, tmp_path / "gcps.gpkg")
    points = result.points
    seen = points.seen_by(scene.truth, SIZE)
    miss = np.hypot(*seen.residuals_px(None).T)[points.used]
    assert len(miss) > 20
    assert (miss < 2).mean() >= 0.9
    assert np.median(miss) < 0.7
    assert result.summary()["verdict"]["accepted"]
    assert (tmp_path / "gcps.gpkg").exists()
    assert "accepted" in result.lines()[0]
    survey = result.summary()["survey"]
    assert survey["chips"] >= survey["confirming"] > survey["chips"] / 2
    assert any(line.startswith("all over the overlap: ") for line in result.lines())


@pytest.mark.slow
def test_what_a_classifier_leaves_out_of_the_image_takes_no_part(
    scene: Scene, tmp_path: Path
) -> None:
    with open_raster(scene.image, allow_sensor_geometry=True) as source:
        values = source.read(source.window)[0]
    half = SIZE[0] // 2
    values = np.where(np.arange(SIZE[0]) < half, values / 2, 128 + values / 2)
    values = values.astype(np.uint8)
    image = write_raster(
        tmp_path / "bright.tif", values, nodata=0, rpcs=to_rasterio(scene.delivered)
    )
    classifier = bright_is_left_out(tmp_path / "c.json", 128)
    found = call(scene, tmp_path / "g.csv", image=image, image_mask=classifier).points
    # Chips whose middles lie just in the bright half still see some of the other one.
    used = found.input_px[found.used]
    assert len(used) > 10
    assert used[:, 0].max() < half + 40
    miss = np.hypot(*found.seen_by(scene.truth, SIZE).residuals_px(None).T)[found.used]
    assert np.median(miss) < 0.7


def elsewhere(scene: Scene, folder: Path) -> dict[str, Path]:
    """Return a reference of other ground at the same place."""
    with open_raster(scene.reference) as source:
        grid = source.grid
    other = ground_texture(grid.width, seed=77).astype(np.uint8)
    return {"reference": write_raster(folder / "other.tif", other, grid)}


def far(scene: Scene, folder: Path) -> dict[str, Path]:
    """Return a reference of another place: the RPCs are of another image."""
    with open_raster(scene.reference) as source:
        grid = source.grid.shifted(40_000.0, 0.0)
        values = source.read(source.window)[0]
    return {"reference": write_raster(folder / "far.tif", values.astype(np.uint8), grid)}


def placeless(scene: Scene, folder: Path) -> dict[str, Path]:
    return {"reference": write_raster(folder / "none.tif", np.ones((50, 50), np.uint8))}


def small_dem(scene: Scene, folder: Path) -> dict[str, Path]:
    with open_raster(scene.dem) as source:
        part = Grid(source.grid.transform, source.grid.crs, 40, 40)
        values = source.read(source.window)[0][:40, :40]
    return {"dem": write_raster(folder / "small.tif", values, part)}


def empty(scene: Scene, folder: Path) -> dict[str, Path]:
    with open_raster(scene.reference) as source:
        grid = source.grid
    zeros = np.zeros((grid.height, grid.width), np.uint8)
    return {"reference": write_raster(folder / "empty.tif", zeros, grid, nodata=0)}


def no_rpcs(scene: Scene, folder: Path) -> dict[str, Path]:
    return {"image": write_raster(folder / "plain.tif", np.ones((50, 50), np.uint8))}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "error", "reason"),
    [
        (elsewhere, NotRegisteredError, "was not matched with"),
        (far, GroundTieError, "do not overlap"),
        (placeless, GroundTieError, "has no CRS"),
        (small_dem, NotRegisteredError, "was not matched with"),
        (empty, GroundTieError, "no valid pixel"),
        (no_rpcs, GroundTieError, "has no RPCs"),
    ],
)
def test_what_cannot_be_matched_writes_nothing(
    scene: Scene, tmp_path: Path, change: object, error: type[Exception], reason: str
) -> None:
    output = tmp_path / "gcps.gpkg"
    with pytest.raises(error, match=reason):
        call(scene, output, **change(scene, tmp_path))  # type: ignore[operator]
    assert not output.exists()


@pytest.mark.slow
def test_the_map_may_have_another_crs(scene: Scene, tmp_path: Path) -> None:
    from rasterio.warp import Resampling, calculate_default_transform, reproject

    with open_raster(scene.reference) as source:
        values, grid = source.read(source.window)[0], source.grid
    crs = CRS.from_epsg(3035)
    bounds = apply_affine(grid.transform, [(0, grid.height), (grid.width, 0)]).ravel()
    transform, width, height = calculate_default_transform(
        grid.crs, crs, grid.width, grid.height, *bounds, resolution=1.0
    )
    out = np.zeros((height, width), np.uint8)
    reproject(
        values.astype(np.uint8), out, src_transform=grid.transform, src_crs=grid.crs,
        dst_transform=transform, dst_crs=crs, resampling=Resampling.cubic,
    )  # fmt: skip
    turned = write_raster(tmp_path / "laea.tif", out, Grid(transform, crs, width, height), nodata=0)
    result = call(scene, tmp_path / "gcps.geojson", reference=turned)
    seen = result.points.seen_by(scene.truth, SIZE)
    miss = np.hypot(*seen.residuals_px(None).T)[result.points.used]
    assert np.median(miss) < 0.8
