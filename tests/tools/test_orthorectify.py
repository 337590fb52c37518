from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from cv2 import erode
from raster_files import full_disk, write_raster
from rasterio.crs import CRS
from rasterio.warp import Resampling
from rasterio.warp import reproject as gdal_reproject
from rpc_models import camera_rpc, to_rasterio, write_dem, write_positions

import groundtie
from groundtie.errors import GroundTieError, NoOverlapError, OutputError, ParameterError
from groundtie.rasters.grid import LON_LAT, Grid, apply_affine, reproject
from groundtie.sensor.rpc_files import write_rpc

RPC = camera_rpc()
UTM = CRS.from_epsg(32632)


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    return {
        "image": write_positions(tmp_path / "image.tif", RPC),
        "dem": write_dem(tmp_path / "dem.tif"),
        "output": tmp_path / "ortho.tif",
    }


def by_gdal(files: dict[str, Path], like: Path, resampling: str) -> np.ndarray:
    """Return GDAL's exact orthoimage of the same grid, NaN where it has nothing."""
    with rasterio.open(like) as ortho, rasterio.open(files["image"]) as image:
        out = np.full((image.count, ortho.height, ortho.width), np.nan, np.float32)
        gdal_reproject(
            image.read(),
            out,
            rpcs=image.rpcs,
            src_crs="EPSG:4326",
            dst_crs=ortho.crs,
            dst_transform=ortho.transform,
            dst_nodata=np.nan,
            resampling=Resampling[resampling],
            tolerance=0,
            RPC_DEM=str(files["dem"]),
        )
    return out


@pytest.mark.parametrize("origin", [(0, 0), (300, 200)])
def test_a_piece_of_an_image_is_named(files: dict[str, Path], origin: tuple[int, int]) -> None:
    """As rasterio writes a window, with the RPCs of the whole image."""
    if origin != (0, 0):
        with rasterio.open(files["image"], "r+") as image:
            image.transform = Affine.translation(*origin)
    result = groundtie.orthorectify(**files, dem_datum="ellipsoidal")
    warned = re.findall("counts its pixels from ([0-9, .-]+)", "\n".join(result.lines()))
    assert warned == ([] if origin == (0, 0) else ["300, 200, "])


@pytest.mark.slow
@pytest.mark.parametrize("resampling", ["bilinear", "cubic"])
def test_positions_are_those_of_gdal(files: dict[str, Path], resampling: str) -> None:
    """The image holds its own columns and rows, so the orthoimage's values are positions."""
    groundtie.orthorectify(**files, dem_datum="ellipsoidal", resampling=resampling)
    with rasterio.open(files["output"]) as ortho:
        own, crs = ortho.read(), ortho.crs
    expected = by_gdal(files, files["output"], resampling)
    both = np.isfinite(own).all(axis=0) & np.isfinite(expected).all(axis=0)
    assert crs == UTM
    assert both.mean() > 0.7
    assert np.abs(own - expected)[:, both].max() < 0.05
    # Outlines agree but for a pixel's width.
    assert (np.isfinite(own[0]) != np.isfinite(expected[0])).mean() < 0.01


@pytest.mark.slow
def test_where_no_height_is_known_there_is_no_data(files: dict[str, Path], tmp_path: Path) -> None:
    whole = groundtie.orthorectify(**files, dem_datum="ellipsoidal")
    assert "covers" not in whole.heights
    part = {**files, "dem": write_dem(tmp_path / "part.tif", size=16), "output": tmp_path / "p.tif"}
    call = {**part, "dem_datum": "ellipsoidal", "reference": files["output"]}
    result = groundtie.orthorectify(**call)
    share = int(re.search(r"which covers (\d+) % of the image", result.heights)[1])
    with rasterio.open(files["output"]) as all_of_it, rasterio.open(part["output"]) as some:
        expected, found = all_of_it.read(1), some.read(1)
    known = np.isfinite(found)
    # Within half a pixel of its rim, 13 m, a terrain model does not know how it goes on.
    inside = erode(known.astype(np.uint8), np.ones((31, 31), np.uint8), borderValue=0) > 0
    np.testing.assert_allclose(found[inside], expected[inside], atol=0.02)
    # The share is counted at one height; relief of ± 100 m, seen aslant, moves the rim by 30 m.
    assert known.sum() / np.isfinite(expected).sum() == pytest.approx(share / 100, abs=0.05)
    assert 30 < share < 70
    with pytest.raises(NoOverlapError, match=f"covers only {share} % of the area of .*than 90 %"):
        groundtie.orthorectify(**call, dem_cover=90)
    # Without a grid of its own it gets one of the whole image.
    own = groundtie.orthorectify(**part, dem_datum="ellipsoidal")
    assert abs(own.grid.width - whole.grid.width) < 60


@pytest.mark.parametrize("rise_m", [30.0, -30.0])
@pytest.mark.parametrize("east_m", [-6.0, 0.0, 0.6])
@pytest.mark.slow
def test_a_wall_amid_the_image_does_not_tell_the_pixel_size(
    files: dict[str, Path], tmp_path: Path, east_m: float, rise_m: float
) -> None:
    """The camera's pixels are of 1 m on level ground, here of the wall's foot or of its top."""
    centre = reproject(RPC.localise([[299.5, 249.5]], 200.0), LON_LAT, UTM)[0]
    grid = Grid(Affine(0.5, 0, centre[0] - 600, 0, -0.5, centre[1] + 600), UTM, 2400, 2400)
    east = grid.pixel_to_map(np.column_stack([np.arange(2400), np.zeros(2400)]))[:, 0] - centre[0]
    heights = np.where(east > east_m, 200.0 + rise_m, 200.0).astype(np.float32)
    dsm = write_raster(tmp_path / "dsm.tif", np.tile(heights, (2400, 1)), grid)
    result = groundtie.orthorectify(
        files["image"], files["output"], dsm, dem_datum="ellipsoidal", resampling="nearest"
    )
    assert result.grid.pixel_size_m == pytest.approx(1.0, rel=0.005)


def test_the_grid_covers_a_narrow_hill_at_the_border(tmp_path: Path) -> None:
    rpc = camera_rpc(pixel_m=5.0, turn_deg=0.0)
    image = write_positions(tmp_path / "image.tif", rpc)
    # 250 m high and 50 m wide; by its height, the border lies 60 m further west.
    hill = rpc.localise([[0.0, 249.5]], 250.0)[0]
    step = 10 / 111_195.0
    corner = np.array([9.0, 45.15]) + [-420 * step, 300 * step]
    grid = Grid(Affine(1.4 * step, 0, corner[0], 0, -step, corner[1]), LON_LAT, 600, 600)
    places = grid.pixel_to_map(np.stack(np.meshgrid(*2 * [np.arange(600)]), -1).reshape(-1, 2))
    east, north = ((places - hill) * [78_600.0, 111_195.0]).T
    heights = 100 + 250 * np.exp(-((east / 200) ** 2) - (north / 35) ** 2)
    dem = write_raster(tmp_path / "dem.tif", heights.reshape(600, 600).astype(np.float32), grid)
    output = tmp_path / "ortho.tif"
    own = groundtie.orthorectify(image, output, dem, dem_datum="ellipsoidal").grid
    wider = own.window(-30, -30, own.width + 60, own.height + 60)
    like = write_raster(tmp_path / "like.tif", np.zeros(wider.size[::-1], np.uint8), wider)
    seen = np.isfinite(by_gdal({"image": image, "dem": dem}, like, "nearest")[0])
    assert seen.sum() == seen[30:-30, 30:-30].sum() > 290_000


@pytest.mark.parametrize(
    "stated",
    [
        {"crs": "EPSG:4326"},
        {"crs": "EPSG:4326", "transform": Affine(1e-5, 1e-6, 9.0, 1e-6, -1e-5, 45.2)},
        {"crs": UTM, "transform": Affine(0.1, 0, 499_000, 0, -0.1, 4_999_000)},
    ],
)
def test_another_georeferencing_than_the_rpcs_does_not_count(
    files: dict[str, Path], tmp_path: Path, stated: dict[str, Any]
) -> None:
    expected = groundtie.orthorectify(files["image"], files["output"], crs="EPSG:4326")
    expected_utm = groundtie.orthorectify(files["image"], files["output"])
    with rasterio.open(files["image"]) as plain:
        also = write_raster(tmp_path / "also.tif", plain.read(), rpcs=plain.rpcs, **stated)
    assert groundtie.orthorectify(also, tmp_path / "o.tif", crs="EPSG:4326").grid == expected.grid
    assert groundtie.orthorectify(also, tmp_path / "o.tif").grid == expected_utm.grid


def test_the_grid_of_a_reference_is_taken(files: dict[str, Path], tmp_path: Path) -> None:
    grid = Grid(Affine(2, 0, 499_900, 0, -2, 4_999_800), UTM, 90, 70)
    groundtie.orthorectify(**files, dem_datum="ellipsoidal", pixel_size=2.0)
    with rasterio.open(files["output"]) as ortho:
        (x, y) = apply_affine(ortho.transform, [ortho.width / 2, ortho.height / 2])[0]
    grid = Grid(Affine(2, 0, round(x), 0, -2, round(y)), UTM, 90, 70)
    reference = write_raster(tmp_path / "reference.tif", np.ones((70, 90), np.uint8), grid)
    result = groundtie.orthorectify(
        **files, dem_datum="ellipsoidal", reference=reference, resampling="bilinear"
    )
    assert result.grid == grid
    with rasterio.open(files["output"]) as ortho:
        assert (ortho.width, ortho.height, ortho.transform) == (90, 70, grid.transform)
        expected = by_gdal(files, files["output"], "bilinear")
        assert np.abs(ortho.read() - expected).max() < 0.05


def test_a_geoid_moves_what_is_seen_from_aside(files: dict[str, Path], tmp_path: Path) -> None:
    """Heights above a geoid 40 m high are the same as heights that are 40 m larger."""
    geoid = write_raster(
        tmp_path / "geoid.tif",
        np.full((4, 4), 40, np.float32),
        crs=CRS.from_epsg(4326),
        transform=Affine(1, 0, 7, 0, -1, 47),
    )
    groundtie.orthorectify(**files, geoid=geoid, crs="EPSG:32632", pixel_size=3.0)
    raised = {"dem": write_dem(tmp_path / "raised.tif", offset_m=40.0), "image": files["image"]}
    expected = by_gdal(raised, files["output"], "bilinear")
    with rasterio.open(files["output"]) as ortho:
        own = ortho.read()
    # 3 m pixels are means of 3 × 3: at a slant a mean of positions is not the position.
    assert np.nanquantile(np.abs(own - expected), 0.9) < 0.5
    groundtie.orthorectify(**files, dem_datum="ellipsoidal", crs="EPSG:32632", pixel_size=3.0)
    with rasterio.open(files["output"]) as ortho:
        assert np.nanmedian(np.abs(ortho.read() - by_gdal(raised, files["output"], "bilinear"))) > 2


def test_without_a_terrain_model_one_height_holds(files: dict[str, Path]) -> None:
    del files["dem"]
    result = groundtie.orthorectify(**files, height=250.0, resampling="bilinear")
    with rasterio.open(files["output"]) as ortho, rasterio.open(files["image"]) as image:
        out = np.full((2, ortho.height, ortho.width), np.nan, np.float32)
        gdal_reproject(
            image.read(), out, rpcs=to_rasterio(RPC), src_crs="EPSG:4326", dst_crs=ortho.crs,
            dst_transform=ortho.transform, dst_nodata=np.nan, resampling=Resampling.bilinear,
            tolerance=0, RPC_HEIGHT="250",
        )  # fmt: skip
        assert np.nanmax(np.abs(ortho.read() - out)) < 0.05
    assert "250 m" in result.heights


def test_a_cloud_optimized_geotiff_holds_the_same(files: dict[str, Path]) -> None:
    groundtie.orthorectify(**files, dem_datum="ellipsoidal", pixel_size=2.0)
    with rasterio.open(files["output"]) as plain:
        expected = plain.read()
    plainly = files["output"]
    files["output"] = plainly.with_name("ortho.cog.tif")
    groundtie.orthorectify(**files, dem_datum="ellipsoidal", pixel_size=2.0)
    with rasterio.open(files["output"]) as cog:
        assert cog.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        np.testing.assert_array_equal(cog.read(), expected)
    assert sorted(path.name for path in files["output"].parent.iterdir()) == [
        "dem.tif", "image.tif", "ortho.cog.tif", "ortho.tif",
    ]  # fmt: skip


@pytest.mark.slow
def test_other_rpcs_can_be_given(files: dict[str, Path], tmp_path: Path) -> None:
    write_rpc(tmp_path / "moved_RPC.TXT", RPC.shifted((7.0, -4.0)))
    plain = groundtie.orthorectify(**files, dem_datum="ellipsoidal", resampling="bilinear")
    with rasterio.open(files["output"]) as ortho:
        before = ortho.read()
    reference = tmp_path / "before.tif"
    files["output"].rename(reference)
    moved = groundtie.orthorectify(
        **files, dem_datum="ellipsoidal", resampling="bilinear", reference=reference,
        rpc=tmp_path / "moved_RPC.TXT",
    )  # fmt: skip
    assert moved.grid == plain.grid
    with rasterio.open(files["output"]) as ortho:
        difference = ortho.read() - before
    assert np.nanmedian(difference[0]) == pytest.approx(7, abs=1e-2)
    assert np.nanmedian(difference[1]) == pytest.approx(-4, abs=1e-2)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, "count from"),
        ({"dem_datum": "ellipsoidal", "height": 5.0}, "either a terrain model"),
        ({"dem": None, "dem_datum": "EGM96"}, "goes with a terrain model"),
        ({"dem_datum": "ellipsoidal", "crs": "EPSG:none"}, "crs is not understood"),
        ({"dem_datum": "ellipsoidal", "reference": "dem.tif", "crs": "EPSG:3035"}, "either a ref"),
    ],
)
def test_parameters_that_do_not_go_together(
    files: dict[str, Path], changes: dict[str, object], reason: str
) -> None:
    if "reference" in changes:
        changes = changes | {"reference": write_dem(files["dem"].with_name("other.tif"))}
    with pytest.raises(ParameterError, match=reason):
        groundtie.orthorectify(**(files | changes))  # type: ignore[arg-type]
    assert not files["output"].exists()


@pytest.mark.parametrize("datum", ["ellipsoidal", "EGM96"])
@pytest.mark.parametrize(
    ("vertical", "name"), [("5783", "DHHN92"), ("5703", "NAVD88"), ("5798", "EGM84")]
)
def test_a_terrain_model_of_another_datum_needs_its_geoid(
    files: dict[str, Path], tmp_path: Path, vertical: str, name: str, datum: str
) -> None:
    files["dem"] = write_dem(tmp_path / "dem.tif", f"EPSG:32632+{vertical}")
    with pytest.raises(ParameterError, match=f"count from {name} height, not {datum}: give"):
        groundtie.orthorectify(**files, dem_datum=datum)
    assert not files["output"].exists()
    grid = Grid(Affine(0.25, 0, 8, 0, -0.25, 46), CRS.from_epsg(4326), 9, 9)
    geoid = write_raster(tmp_path / "geoid.tif", np.zeros((9, 9), np.float32), grid)
    assert groundtie.orthorectify(**files, geoid=geoid).output.exists()


def test_an_image_without_rpcs_writes_nothing(files: dict[str, Path]) -> None:
    write_raster(files["image"], np.ones((20, 20), np.uint8))
    with pytest.raises(GroundTieError, match="has no RPCs"):
        groundtie.orthorectify(**files, dem_datum="ellipsoidal")
    assert not files["output"].exists()


def test_a_reference_elsewhere_writes_nothing(files: dict[str, Path], tmp_path: Path) -> None:
    reference = write_raster(
        tmp_path / "far.tif",
        np.ones((20, 20), np.uint8),
        Grid(Affine(1, 0, 700_000, 0, -1, 4_000_000), UTM, 20, 20),
    )
    with pytest.raises(GroundTieError, match="does not lie on the grid"):
        groundtie.orthorectify(**files, dem_datum="ellipsoidal", reference=reference)
    assert not files["output"].exists()


@pytest.mark.parametrize("height", [-250.0, 1050.0, 5000.0])
def test_a_height_at_which_the_rpcs_do_not_hold_is_refused(
    files: dict[str, Path], height: float
) -> None:
    """They are made for 0 to 800 m, and hold for half of that beyond."""
    with pytest.raises(ParameterError, match=r"at a height of .* only from -200 to 1000 m"):
        groundtie.orthorectify(files["image"], files["output"], height=height)
    assert not files["output"].exists()


def test_an_orthoimage_without_data_is_not_written(files: dict[str, Path], tmp_path: Path) -> None:
    """The grid shows the image, but none of the ground whose height is known."""
    files["dem"] = write_dem(tmp_path / "part.tif", size=16)
    groundtie.orthorectify(files["image"], files["output"], height=300.0)
    with rasterio.open(files["output"]) as ortho:
        left, top, crs = ortho.bounds.left + 80, ortho.bounds.top - 80, ortho.crs
    files["output"].unlink()
    grid = Grid(Affine(1, 0, left, 0, -1, top), crs, 20, 20)
    corner = write_raster(tmp_path / "corner.tif", np.ones((20, 20), np.uint8), grid)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(NoOverlapError, match="would hold no data"):
        groundtie.orthorectify(**files, dem_datum="ellipsoidal", reference=corner)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("name", ["ortho.tif", "ortho.cog.tif"])
def test_a_full_disk_leaves_nothing_behind(files: dict[str, Path], name: str) -> None:
    files["output"] = files["output"].with_name(name)
    with full_disk(100_000), pytest.raises(OutputError):
        groundtie.orthorectify(**files, dem_datum="ellipsoidal")
    assert sorted(path.name for path in files["output"].parent.iterdir()) == [
        "dem.tif", "image.tif",
    ]  # fmt: skip


def test_no_heights_are_invented_beyond_the_rim_of_a_terrain_model(
    files: dict[str, Path], tmp_path: Path
) -> None:
    """As of a model whose raster goes on without data; voids inside are filled, and stated."""
    west, hole = np.zeros((60, 60), bool), np.zeros((60, 60), bool)
    west[:, :30], hole[28:34, 36:40] = True, True
    half = {**files, "dem": write_dem(tmp_path / "half.tif", holes=west)}
    found = groundtie.orthorectify(**half, dem_datum="ellipsoidal")
    with rasterio.open(files["output"]) as ortho:
        valid = np.isfinite(ortho.read(1)).sum()
    nodes = np.stack(np.meshgrid(np.arange(0, 600, 10), np.arange(0, 500, 10)), -1).reshape(-1, 2)
    expected = np.mean(RPC.localise(nodes, 300.0)[:, 0] > 9.0)
    assert valid * found.grid.pixel_size_m**2 / (600 * 500) == pytest.approx(expected, abs=0.07)
    share = int(re.search(r"which covers (\d+) % of the image", found.heights)[1])
    assert share / 100 == pytest.approx(expected, abs=0.07)
    with pytest.raises(NoOverlapError, match=f"covers only {share} %"):
        groundtie.orthorectify(**half, dem_datum="ellipsoidal", dem_cover=90)
    whole = {**files, "output": tmp_path / "whole.tif"}
    groundtie.orthorectify(**whole, dem_datum="ellipsoidal")
    holed = {**files, "dem": write_dem(tmp_path / "holed.tif", holes=hole)}
    found = groundtie.orthorectify(**holed, dem_datum="ellipsoidal", reference=whole["output"])
    with rasterio.open(whole["output"]) as expected, rasterio.open(files["output"]) as ortho:
        assert np.mean(np.isfinite(ortho.read(1)) != np.isfinite(expected.read(1))) < 0.01
    # 150 m × 71 m of 600 m × 500 m.
    assert re.search(r"which covers 9[67] % of the image; [34] % are voids that", found.heights)
