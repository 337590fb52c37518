from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from rasterio.crs import CRS

from groundtie.arrays import Raster
from groundtie.errors import GeoreferencingError, NoOverlapError, TransformFileError
from groundtie.geometry.models import TERRAIN, Frame
from groundtie.geometry.terrain import Terrain
from groundtie.geometry.terrain_model import TerrainModel
from groundtie.geometry.transform import Transform, load_transform
from groundtie.rasters.grid import Grid, compose
from groundtie.rasters.writing import write_raster

UTM = CRS.from_epsg(32633)
PX_M = 10.0
GRID = Grid(Affine(PX_M, 0, 400_000, 0, -PX_M, 5_000_000), UTM, 300, 240)
REGION = (400_000.0, 4_997_600.0, 403_000.0, 5_000_000.0)
CENTRE = np.array([401_500.0, 4_998_800.0])
TOWARDS = np.array([-0.8, 0.3])  # metres that a place is displaced by for each of height
AFFINE = np.array([[0.02, -0.01], [0.004, 0.002], [-0.003, 0.001]])


def hill(xy: np.ndarray, height_m: float = 200.0) -> np.ndarray:
    off = (xy - CENTRE) / 600.0
    return height_m * np.exp(-(off**2).sum(axis=1))


def error(xy: np.ndarray) -> np.ndarray:
    return 30 * np.sin(xy[:, 0] / 400) * np.cos(xy[:, 1] / 300)


def heights(of: object) -> np.ndarray:
    cols, rows = np.meshgrid(np.arange(GRID.width), np.arange(GRID.height))
    xy = GRID.pixel_to_map(np.stack([cols, rows], axis=-1).reshape(-1, 2))
    return np.asarray(of(xy), np.float32).reshape(cols.shape)  # type: ignore[operator]


def assumed(xy: np.ndarray) -> np.ndarray:
    return hill(xy) + error(xy)


def terrain(with_assumed: bool = True) -> Terrain:
    rasters = [Raster(heights(of), GRID.transform, UTM) for of in (hill, assumed)]
    return Terrain.open(rasters[0], rasters[1] if with_assumed else None, UTM, REGION)


def model(of: Terrain) -> TerrainModel:
    frame = Frame(compose(Affine.translation(*CENTRE), Affine.scale(1500.0)))
    return TerrainModel(TERRAIN, frame, np.vstack([AFFINE, TOWARDS / 1500.0]), of, 3.0)


def places(count: int = 400) -> np.ndarray:
    return CENTRE + np.random.default_rng(0).uniform(-1000, 1000, (count, 2))


def test_a_place_is_shown_where_its_line_of_sight_meets_the_heights_assumed() -> None:
    """The definition, with the analytic heights: shown = X + affine + (H(X) − H0(shown)) · d."""
    xy = places()
    found = model(terrain())
    shown = found(xy)
    straight = found.affine(xy)
    expected = straight + (hill(xy) - assumed(shown) - 3.0)[:, None] * TOWARDS
    # Bilinear heights of 10 m pixels are some centimetres off the analytic ones.
    np.testing.assert_allclose(shown, expected, atol=0.2)
    assert np.hypot(*(shown - straight).T).max() > 10


def test_in_layover_lines_of_sight_end_on_the_heights_too() -> None:
    """A ridge so steep that they meet it more than once: the height is one of those."""

    def ridge(xy: np.ndarray) -> np.ndarray:
        return 300 * np.exp(-(((xy[:, 0] - CENTRE[0]) / 80.0) ** 2))

    flat, steep = (
        Raster(heights(of), GRID.transform, UTM) for of in (lambda xy: np.zeros(len(xy)), ridge)
    )
    found = model(Terrain.open(flat, steep, UTM, REGION))
    xy = places(4000)
    uv = found.frame.enter(xy)
    shown = found(xy)
    assert np.diff(np.sort(shown[:, 0])).max() > 50  # nothing is shown behind the ridge
    rise = -3.0 - found.terrain.assumed_m(shown)
    np.testing.assert_allclose(found.rise_m(uv), rise, atol=0.05)


def test_heights_count_where_they_are_shown_not_where_they_are() -> None:
    """On a slope this differs from the heights' difference at one place by metres."""
    xy = places()
    found = model(terrain())
    at_once = found.affine(xy) + (hill(xy) - assumed(xy) - 3.0)[:, None] * TOWARDS
    assert np.hypot(*(found(xy) - at_once).T).max() > 5


def test_one_height_displaces_in_proportion_to_the_ground() -> None:
    xy = places()
    found = model(terrain(with_assumed=False))
    expected = found.affine(xy) + (hill(xy) - 3.0)[:, None] * TOWARDS
    np.testing.assert_allclose(found(xy), expected, atol=0.1)


@pytest.mark.parametrize("with_assumed", [True, False])
def test_the_inverse_takes_back(with_assumed: bool) -> None:
    xy = places()
    found = model(terrain(with_assumed))
    np.testing.assert_allclose(found.inverse(found(xy)), xy, atol=0.1)


def test_on_pixels_and_on_the_map_it_is_the_same() -> None:
    of = terrain()
    on_map = model(of)
    to_map = GRID.centre_transform
    frame = Frame(compose(~to_map, on_map.frame.to_map))
    on_pixels = TerrainModel(TERRAIN, frame, on_map.coefficients, of.seen_from(to_map), 3.0)
    px = GRID.map_to_pixel(places())
    expected = GRID.map_to_pixel(on_map(places()))
    np.testing.assert_allclose(on_pixels(px), expected, atol=1e-6)
    np.testing.assert_allclose(on_pixels.on_map(to_map)(places()), on_map(places()), atol=1e-5)


def stored(folder: Path) -> tuple[Path, Transform]:
    paths = folder / "dem.tif", folder / "taken.tif"
    for path, of in zip(paths, (hill, assumed), strict=True):
        write_raster(path, heights(of)[None], GRID, ["height"])
    found = Transform(model(Terrain.open(*map(str, paths), UTM, REGION)), UTM, GRID)
    path = folder / "transform.json"
    path.write_text(json.dumps(found.to_json()))
    return path, found


def test_a_stored_transform_finds_its_heights(tmp_path: Path) -> None:
    path, found = stored(tmp_path)
    np.testing.assert_allclose(load_transform(path)(places()), found(places()), atol=1e-6)


def test_it_names_the_heights_that_were_opened_whatever_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("there", "other"):
        (tmp_path / name).mkdir()
        write_raster(tmp_path / name / "dem.tif", heights(hill)[None], GRID, ["height"])
    monkeypatch.chdir(tmp_path / "there")
    found = Terrain.open("dem.tif", None, UTM, REGION)
    monkeypatch.chdir(tmp_path / "other")
    assert Path(found.to_json()["dem"]) == (tmp_path / "there" / "dem.tif").resolve()


def test_it_finds_them_beside_itself_when_both_were_moved(tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    path, found = stored(before)
    before.rename(after)
    moved = load_transform(after / path.name)
    np.testing.assert_allclose(moved(places()), found(places()), atol=1e-6)


def test_other_heights_than_its_own_are_refused(tmp_path: Path) -> None:
    path, _ = stored(tmp_path)
    write_raster(tmp_path / "dem.tif", heights(hill)[None] + 1, GRID, ["height"])
    with pytest.raises(TransformFileError, match="not those that the transform was made with"):
        load_transform(path)


def test_without_its_heights_it_is_refused(tmp_path: Path) -> None:
    path, _ = stored(tmp_path)
    (tmp_path / "dem.tif").unlink()
    with pytest.raises(TransformFileError, match=r"dem\.tif, whose heights .* is not there"):
        load_transform(path)


@pytest.mark.parametrize(
    ("key", "value"),
    [("origin_m", None), ("coefficients", [[0, 0]]), ("region", [1, 2]), ("heights_m", "x")],
)
def test_damaged_values_are_refused(tmp_path: Path, key: str, value: object) -> None:
    path, _ = stored(tmp_path)
    values = json.loads(path.read_text())
    values["model"][key] = value
    path.write_text(json.dumps(values))
    with pytest.raises(TransformFileError):
        load_transform(path)


def test_heights_hold_on_beyond_a_raster_only_where_they_are_asked_for() -> None:
    of = replace(terrain())
    edge, beyond, outside = [[402_995.0, 4_998_805.0], [403_000.0, 4_998_805.0], [404_000.0, 0]]
    inside = of.ground_m(np.array([edge, beyond, outside]))
    assert inside[0] == pytest.approx(inside[1])
    assert np.isnan(inside[2])


def test_terrain_models_must_cover_the_overlap() -> None:
    of = terrain()
    of.require_cover(GRID, GRID, UTM)
    wider = GRID.window(-30, 0, 330, 240)
    with pytest.raises(NoOverlapError, match=r"covers only 9\d % of where the images overlap"):
        of.require_cover(wider, wider, UTM)
    of.require_cover(wider, GRID, UTM)  # nothing more of the input is there


@pytest.mark.parametrize("input_dem", [False, True])
def test_voids_open_to_the_edge_cover_nothing_and_those_amid_heights_do(input_dem: bool) -> None:
    full = heights(hill)

    def of(void: tuple[slice, slice]) -> Terrain:
        part = full.copy()
        part[void] = -9999
        models = [Raster(values, GRID.transform, UTM) for values in (part, full)]
        ground, assumed = models[::-1] if input_dem else models
        return Terrain.open(ground, assumed, UTM, REGION)

    of(np.s_[100:150, 100:180]).require_cover(GRID, GRID, UTM)
    # 180 of 300 columns are left: 20 of 33 places along a row.
    with pytest.raises(NoOverlapError, match=r"covers only 60 % of where the images overlap"):
        of(np.s_[:, 180:]).require_cover(GRID, GRID, UTM)


def test_a_terrain_model_without_a_crs_has_no_place_on_a_map_with_one() -> None:
    with pytest.raises(GeoreferencingError, match="only one of"):
        Terrain.open(Raster(heights(hill), GRID.transform), None, UTM, REGION)


@pytest.mark.parametrize("turn", [0.0, 360.0])
def test_terrain_models_may_count_longitudes_from_zero(turn: float) -> None:
    """A map at 100° west, heights in 0° to 360°, as climate models have them."""
    lon_lat, rows = CRS.from_epsg(4326), np.arange(240, dtype=np.float32)
    own = Affine(0.005, 0, -100.5 + turn, 0, -0.005, 45.5)
    raster = Raster(np.tile(rows[:, None], (1, 300)), own, lon_lat)
    grid = Grid(Affine(0.005, 0, -100.2, 0, -0.005, 45.0), lon_lat, 60, 40)
    of = Terrain.open(raster, None, lon_lat, (-100.2, 44.8, -99.9, 45.0))
    of.require_cover(grid, grid, lon_lat)
    found = of.ground_m(np.array([[-100.1, 44.9], [-100.0, 44.85]]))
    assert found == pytest.approx([119.5, 129.5], abs=0.01)
