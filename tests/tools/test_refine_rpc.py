from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from html_pages import Page
from raster_files import full_disk
from rpc_models import camera_rpc, to_rasterio, write_dem, write_positions
from rpc_scenes import SIZE, Scene, ground_texture, make_scene

import groundtie
from benchmarks.rpc import rms
from benchmarks.rpc_city import misses_px
from groundtie.errors import (
    GroundTieError,
    NotRegisteredError,
    OutputError,
    ParameterError,
    SameFileError,
)
from groundtie.geometry.accuracy import Common
from groundtie.registration.evidence import RegistrationEvidence
from groundtie.sensor.bias import Bias, fold
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc, write_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags

DRIFT = Bias("shift_drift", SIZE, np.array([[-27.0, 33.0], [2.5, -3.0]]), np.zeros((4, 4)))
TRUTH = camera_rpc()
POINTS_SIZE = (600, 500)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return make_scene(tmp_path_factory.mktemp("scene"), DRIFT)


@pytest.mark.slow
def test_a_reference_and_a_terrain_model_make_the_rpcs_right(scene: Scene, tmp_path: Path) -> None:
    result = groundtie.refine_rpc(
        scene.image,
        tmp_path / "refined_RPC.TXT",
        scene.reference,
        dem=scene.dem,
        dem_datum="ellipsoidal",
        residuals=tmp_path / "residuals.gpkg",
        report=tmp_path / "report.html",
    )
    assert scene.error_px(scene.delivered) > 30
    assert scene.error_px(read_rpc(tmp_path / "refined_RPC.TXT")) < 1.0
    assert result.evidence.before.rmse > 30
    assert result.evidence.after.rmse < 1.5
    assert result.evidence.held_out.name == "check points"
    assert result.mask is not None
    assert (result.mask.kind, result.mask.image) == ("none", None)
    page = Page((tmp_path / "report.html").read_text())
    sources = [str(image.attributes["src"]) for image in page.all("img")]
    assert len(sources) == 6 and all(source.startswith("data:image/") for source in sources)
    assert "Check points confirm the refined RPCs." in page.text
    assert "The image on the map" in page.text
    numbers = json.loads((tmp_path / "report.json").read_text())
    assert numbers["verdict"]["check_rmse_px"] == result.verdict.check_rmse_px
    assert numbers["bias"]["model"] == result.adjustment.bias.kind
    assert numbers["parameters"]["dem_datum"] == "ellipsoidal"
    import fiona

    with fiona.open(tmp_path / "residuals.gpkg") as layer:
        rows = [feature["properties"] for feature in layer]
    used = [row["residual_px"] for row in rows if row["state"] == "used"]
    assert np.median(used) < 1.5


@pytest.mark.slow
def test_a_terrain_model_of_a_part_serves_for_matching_that_part(
    scene: Scene, tmp_path: Path
) -> None:
    with rasterio.open(scene.dem) as dem:
        profile, heights = dem.profile, dem.read(1)
    profile["width"] = int(dem.width * 0.52)
    with rasterio.open(tmp_path / "part.tif", "w", **profile) as part:
        part.write(heights[:, : profile["width"]], 1)
    result = groundtie.refine_rpc(
        scene.image,
        tmp_path / "refined_RPC.TXT",
        scene.reference,
        dem=tmp_path / "part.tif",
        dem_datum="ellipsoidal",
        model="shift_drift",
    )
    assert "part.tif above the ellipsoid, which covers" in result.ground
    # As processes give results back.
    assert pickle.loads(pickle.dumps(result)).lines() == result.lines()
    assert scene.error_px(read_rpc(tmp_path / "refined_RPC.TXT")) < 1.0


@pytest.mark.slow
def test_what_displaces_the_match_displaces_the_rpcs(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """3 m, in matching pixels of 2 m; the image's pixels are 1 m."""
    alike = Common(np.array([1.5, 0.0]))
    plain = RegistrationEvidence.error.func
    error = property(lambda evidence: replace(plain(evidence), common=alike))
    monkeypatch.setattr(RegistrationEvidence, "error", error)
    found = groundtie.refine_rpc(
        scene.image,
        tmp_path / "refined_RPC.TXT",
        scene.reference,
        dem=scene.dem,
        dem_datum="ellipsoidal",
        matching_pixel_size=2.0,
    )
    assert found.verdict.accuracy.heights_px == pytest.approx(3.0, rel=0.1)
    # Nine tenths of what is even up to 3 px, and what other points would have given.
    assert 2.7 < found.verdict.accuracy.ce90_px < 3.5


@pytest.mark.slow
def test_a_refused_matching_leaves_its_report(scene: Scene, tmp_path: Path) -> None:
    """The reference shows other ground."""
    with rasterio.open(scene.reference) as source:
        profile, side = source.profile, source.width
    with rasterio.open(tmp_path / "other.tif", "w", **profile) as other:
        other.write(ground_texture(side, seed=77).astype(profile["dtype"]), 1)
    with pytest.raises(NotRegisteredError, match="was not matched with"):
        groundtie.refine_rpc(
            scene.image,
            tmp_path / "refined_RPC.TXT",
            tmp_path / "other.tif",
            dem=scene.dem,
            dem_datum="ellipsoidal",
            report=tmp_path / "report.html",
        )
    assert "Refused" in [
        heading.text for heading in Page((tmp_path / "report.html").read_text()).all("h2")
    ]
    assert not (tmp_path / "refined_RPC.TXT").exists()


@pytest.mark.slow
def test_a_small_dense_town_is_right_by_colours_and_refused_without(tmp_path: Path) -> None:
    """All open ground takes part; by grey levels its few check points may agree on biased RPCs."""
    groundtie.simulate_sensor(tmp_path, density="urban", shift=30.0, seed=6, size=700)

    def refine(output: Path, **more: Any) -> None:
        groundtie.refine_rpc(
            tmp_path / "sensor.tif",
            output,
            tmp_path / "reference.tif",
            search_radius=60.0,
            dem=tmp_path / "dem.tif",
            dem_datum="ellipsoidal",
            **more,
        )

    refine(tmp_path / "refined_RPC.TXT")
    assert rms(misses_px(tmp_path, tmp_path / "refined_RPC.TXT")) < 2.0
    with pytest.raises(NotRegisteredError):
        refine(tmp_path / "grey_RPC.TXT", image_band=1)
    assert not (tmp_path / "grey_RPC.TXT").exists()


def write_points(
    folder: Path,
    bias: Bias | None,
    count: int = 40,
    wrong: int = 0,
    corner: float = 1.0,
    height_error_m: float = 0.0,
    name: str = "gcps.csv",
) -> dict[str, Path]:
    """Write an image with biased RPCs, and control points measured to 0.2 px."""
    delivered = TRUTH if bias is None else fold(TRUTH, bias).rpc
    image = write_positions(folder / "image.tif", delivered)
    dem = write_dem(folder / "dem.tif", size=90)
    random = np.random.default_rng(0)
    px = random.uniform(0, 1, (count, 2)) * POINTS_SIZE * corner
    height = random.uniform(100, 500, count)
    lon_lat = TRUTH.localise(px, height)
    px = px + random.normal(0, 0.2, px.shape)
    px[:wrong] += random.uniform(-100, 100, (wrong, 2))
    lines = [
        "reference_x,reference_y,input_col,input_row,height_m,reference_crs,sigma_x_px,sigma_y_px"
    ]
    for (lon, lat), (col, row), z in zip(lon_lat, px, height + height_error_m, strict=True):
        lines.append(f"{lon:.12f},{lat:.12f},{col:.6f},{row:.6f},{z:.4f},EPSG:4326,0.2,0.2")
    (folder / name).write_text("\n".join(lines) + "\n")
    return {"image": image, "gcps": folder / name, "dem": dem}


def error_px(rpc: RPC) -> float:
    nodes = np.stack(np.meshgrid(*(np.linspace(0, side, 9) for side in POINTS_SIZE)), -1)
    px = nodes.reshape(-1, 2)
    return float(
        np.abs(
            TRUTH.project(TRUTH.localise(px, 300.0), 300.0)
            - rpc.project(TRUTH.localise(px, 300.0), 300.0)
        ).max()
    )


def bias_of(kind: str) -> Bias:
    terms = {"shift": 1, "shift_drift": 2, "affine": 3}[kind]
    coefficients = np.array([[14.0, -35.0], [3.0, 2.0], [-2.0, 4.0]])[:terms]
    return Bias(kind, POINTS_SIZE, coefficients, np.zeros((2 * terms,) * 2))


@pytest.mark.parametrize("kind", ["shift", "shift_drift", "affine"])
def test_given_points_recover_a_bias(tmp_path: Path, kind: str) -> None:
    files = write_points(tmp_path, bias_of(kind), 60, wrong=18)
    result = groundtie.refine_rpc(output=tmp_path / "refined.RPB", dem_datum="ellipsoidal", **files)
    assert result.adjustment.bias.kind == kind
    assert error_px(read_rpc(tmp_path / "refined.RPB")) < 0.35
    assert result.verdict.fit_points_used == 42
    assert result.fit.largest_residual_px <= 0.01
    summary = result.summary()
    assert summary["verdict"]["held_out"] == "points left out in turn"
    assert summary["bias"]["model"] == kind
    assert "survey" not in summary  # nothing was matched


def test_an_image_is_copied_with_its_refined_tags(tmp_path: Path) -> None:
    files = write_points(tmp_path, bias_of("shift"))
    groundtie.refine_rpc(output=tmp_path / "refined.tif", dem_datum="ellipsoidal", **files)
    with rasterio.open(files["image"]) as before, rasterio.open(tmp_path / "refined.tif") as after:
        np.testing.assert_array_equal(after.read(), before.read())
        assert after.transform == before.transform
        assert error_px(rpc_from_tags(after.tags(ns="RPC"), "refined")) < 0.35


@pytest.mark.slow
def test_refined_images_orthorectify_to_where_they_belong(tmp_path: Path) -> None:
    files = write_points(tmp_path, bias_of("affine"))
    groundtie.refine_rpc(output=tmp_path / "refined.tif", dem_datum="ellipsoidal", **files)
    groundtie.orthorectify(
        tmp_path / "refined.tif", tmp_path / "ortho.tif", files["dem"], dem_datum="ellipsoidal",
        resampling="bilinear",
    )  # fmt: skip
    right = write_positions(tmp_path / "right.tif", TRUTH)
    with rasterio.open(right, "r+") as dataset:
        dataset.rpcs = to_rasterio(TRUTH)
    groundtie.orthorectify(
        right, tmp_path / "expected.tif", files["dem"], dem_datum="ellipsoidal",
        reference=tmp_path / "ortho.tif", resampling="bilinear",
    )  # fmt: skip
    with rasterio.open(tmp_path / "ortho.tif") as a, rasterio.open(tmp_path / "expected.tif") as b:
        assert np.nanmax(np.abs(a.read() - b.read())) < 0.35


def test_the_vendors_rpcs_are_not_written_over(tmp_path: Path) -> None:
    files = write_points(tmp_path, bias_of("shift"))
    with rasterio.open(files["image"]) as image:
        write_rpc(tmp_path / "image.RPB", rpc_from_tags(image.tags(ns="RPC"), "image"))
    before = (tmp_path / "image.RPB").read_bytes()
    for name, error in (("image.RPB", SameFileError), ("image_RPC.TXT", OutputError)):
        with pytest.raises(error, match=r"image\.RPB"):
            groundtie.refine_rpc(output=tmp_path / name, dem_datum="ellipsoidal", **files)
    assert (tmp_path / "image.RPB").read_bytes() == before
    assert not (tmp_path / "image_RPC.TXT").exists()


def test_right_rpcs_are_left_alone(tmp_path: Path) -> None:
    """The report alone is written, and says so."""
    files = write_points(tmp_path, None)
    before = set(tmp_path.iterdir())
    with pytest.raises(NotRegisteredError, match="not nearer than before"):
        groundtie.refine_rpc(
            output=tmp_path / "refined.RPB",
            dem_datum="ellipsoidal",
            residuals=tmp_path / "residuals.csv",
            report=tmp_path / "report.html",
            **files,
        )
    assert {path.name for path in set(tmp_path.iterdir()) - before} == {
        "report.html",
        "report.json",
    }
    page = Page((tmp_path / "report.html").read_text())
    assert "Refused" in [heading.text for heading in page.all("h2")]
    assert "No refined RPCs were written." in page.text


def test_the_report_tells_the_errors_before_and_after(tmp_path: Path) -> None:
    """40 points, measured to 0.2 px along both axes; a shift by (14, -35) is taken out."""
    files = write_points(tmp_path, bias_of("shift"))
    result = groundtie.refine_rpc(
        output=tmp_path / "refined.RPB",
        dem_datum="ellipsoidal",
        report=tmp_path / "report.html",
        **files,
    )
    page = Page((tmp_path / "report.html").read_text())
    before = float(page.numbers["Error before (RMSE)"].split()[0])
    after = float(page.numbers["Error after (RMSE)"].split()[0])
    assert before == pytest.approx(np.hypot(14, 35), abs=0.3)
    assert after == pytest.approx(0.2 * np.sqrt(2), rel=0.3)
    shift = float(page.numbers["Shift in the middle, column"].split()[0])
    assert abs(shift) == pytest.approx(14, abs=0.2)
    cells = [cell.text for cell in page.all("td")]
    pixels, metres = (float(cells[cells.index(unit) + 1]) for unit in ("px", "m"))
    assert pixels == before
    assert metres / pixels == pytest.approx(1.0, rel=0.05)  # of the made-up camera
    assert len(page.all("img")) == 3
    assert result.files["report"] == str(tmp_path / "report.html")


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        ({"count": 2}, "needs at least 3 control points"),
        ({"corner": 0.2}, "spread over"),
        ({"count": 30, "wrong": 30}, "agree"),
    ],
)
def test_points_that_tell_too_little_are_refused(
    tmp_path: Path, points: dict[str, float], reason: str
) -> None:
    files = write_points(tmp_path, bias_of("shift"), **points)  # type: ignore[arg-type]
    with pytest.raises(NotRegisteredError, match=reason):
        groundtie.refine_rpc(output=tmp_path / "refined.RPB", dem_datum="ellipsoidal", **files)
    assert not (tmp_path / "refined.RPB").exists()


def test_a_shift_by_surveyed_points_needs_no_spread(tmp_path: Path) -> None:
    """Five of them, within a sixth of a side."""
    files = write_points(tmp_path, bias_of("shift"), 5, corner=0.16)
    refined, call = tmp_path / "refined.RPB", {"dem_datum": "ellipsoidal", **files}
    with pytest.raises(NotRegisteredError, match="spread over"):
        groundtie.refine_rpc(output=refined, **call)
    result = groundtie.refine_rpc(output=refined, model="shift", **call)
    assert result.verdict.fit_points_used == 5
    assert error_px(read_rpc(refined)) < 0.35


def test_points_outside_of_the_image_count(tmp_path: Path) -> None:
    """A surveyor's points of the whole strip serve for a part of it."""
    files = write_points(tmp_path, bias_of("shift"), corner=3.0)
    result = groundtie.refine_rpc(output=tmp_path / "refined.RPB", dem_datum="ellipsoidal", **files)
    assert result.verdict.fit_points_used == 40
    assert error_px(read_rpc(tmp_path / "refined.RPB")) < 0.35


def test_points_where_no_height_is_known_are_counted(tmp_path: Path) -> None:
    files = write_points(tmp_path, bias_of("shift"))
    head, *rows = files["gcps"].read_text().splitlines()
    # Three points lie a degree off the terrain model, and state no height.
    for i in range(3):
        lon, lat, col, row, _, *more = rows[i].split(",")
        rows[i] = ",".join([str(float(lon) + 1), lat, col, row, "", *more])
    files["gcps"].write_text("\n".join([head, *rows]))
    result = groundtie.refine_rpc(output=tmp_path / "refined.RPB", dem_datum="ellipsoidal", **files)
    assert result.verdict.fit_points == 37
    assert any(line.startswith("points left out") and "3" in line for line in result.lines())


def test_heights_that_contradict_the_terrain_model_are_told(tmp_path: Path) -> None:
    """The points have heights above the ellipsoid, the terrain model as said, too."""
    files = write_points(tmp_path, bias_of("shift"))
    write_dem(files["dem"], size=90, offset_m=-280.0)
    result = groundtie.refine_rpc(output=tmp_path / "refined.RPB", dem_datum="ellipsoidal", **files)
    assert any("vertical datum" in line for line in result.lines())


def test_one_height_for_all_is_no_terrain_to_contradict(tmp_path: Path) -> None:
    files = write_points(tmp_path, bias_of("shift"))
    del files["dem"]
    result = groundtie.refine_rpc(output=tmp_path / "refined.RPB", height=100.0, **files)
    assert not any("vertical datum" in line for line in result.lines())


@pytest.mark.parametrize(
    ("changes", "error", "reason"),
    [
        ({"gcps": None}, ParameterError, "either a reference or"),
        ({"reference": "dem.tif"}, ParameterError, "either a reference or"),
        ({"dem_datum": None}, ParameterError, "count from"),
        ({"output": "refined.xml"}, ParameterError, r"must end in \.txt"),
        ({"model": "spline"}, ParameterError, "one of auto, shift"),
    ],
)
def test_calls_that_cannot_be_right(
    tmp_path: Path, changes: dict[str, object], error: type[GroundTieError], reason: str
) -> None:
    files = write_points(tmp_path, bias_of("shift"))
    if "reference" in changes:
        changes = changes | {"reference": files["image"]}
    if "output" in changes:
        changes = changes | {"output": tmp_path / str(changes["output"])}
    call = {"output": tmp_path / "refined.RPB", "dem_datum": "ellipsoidal", **files, **changes}
    with pytest.raises(error, match=reason):
        groundtie.refine_rpc(**call)  # type: ignore[arg-type]
    assert not list(tmp_path.glob("refined*"))


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path) -> None:
    files = write_points(tmp_path, bias_of("shift"))
    with full_disk(50_000), pytest.raises(OutputError):
        groundtie.refine_rpc(
            output=tmp_path / "refined.tif",
            residuals=tmp_path / "residuals.gpkg",
            dem_datum="ellipsoidal",
            **files,
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dem.tif", "gcps.csv", "image.tif"]
