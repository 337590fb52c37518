"""Parts of the radar image take no part."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fiona
import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import write_raster
from scipy.ndimage import gaussian_filter
from specified_runs import register_specified
from tools.conftest import SimulatedFiles

from benchmarks.attempt import on_pixels
from benchmarks.cases import draw_shift, read_cases, search_radius_m, write_case
from groundtie import Raster
from groundtie.errors import NotRegisteredError
from groundtie.rasters.reading import open_raster
from groundtie.registration.specification import COREGISTER
from groundtie.tools.coregister import coregister
from groundtie.tools.filter_speckle import filter_speckle
from groundtie.tools.match_optical import match_optical
from groundtie.tools.simulate import simulate


@pytest.mark.slow
def test_a_layer_does_the_same_job(
    simulated: Callable[[str], SimulatedFiles], tmp_path: Path
) -> None:
    """A polygon over the left two thirds: nothing else of the reference takes part."""
    pair = simulated("shift")
    with rasterio.open(pair.reference) as source:
        left, bottom, right, top = source.bounds
        crs = source.crs.to_wkt()
    right = left + (right - left) * 2 / 3
    ring = [(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)]
    schema = {"geometry": "Polygon", "properties": {}}
    layer = tmp_path / "ground.gpkg"
    with fiona.open(layer, "w", driver="GPKG", crs_wkt=crs, schema=schema) as file:
        geometry = {"type": "Polygon", "coordinates": [ring]}
        file.write({"type": "Feature", "geometry": geometry, "properties": {}})
    result = coregister(pair.reference, pair.input, tmp_path / "out.tif", reference_mask=layer)
    mask = result.mask
    assert (mask.kind, mask.image) == ("layer", "reference")
    assert mask.share == pytest.approx(2 / 3, abs=0.01)
    xy = result.tie_points.take(result.tie_points.used).reference_xy
    # Chips may lie across the border, but none beyond it.
    assert np.all(xy[:, 0] < right + 60)


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> SimulatedFiles:
    """Return a dense city, whose buildings agree 4 px off the ground."""
    folder = tmp_path_factory.mktemp("city")
    simulate(folder, 1000, "city", seed=4, changed=10.0)
    return SimulatedFiles(folder)


@pytest.fixture(scope="module")
def open_city(tmp_path_factory: pytest.TempPathFactory) -> SimulatedFiles:
    """Return a dense city of whose ground the radar sees enough to confirm a registration."""
    folder = tmp_path_factory.mktemp("open")
    simulate(folder, 1000, "city", seed=2, changed=10.0)
    return SimulatedFiles(folder)


@pytest.mark.slow
def test_a_dense_city_is_registered_by_its_ground(
    open_city: SimulatedFiles, tmp_path: Path
) -> None:
    result = coregister(open_city.reference, open_city.input, tmp_path / "out.tif")
    mask = result.mask
    assert (mask.kind, mask.image) == ("ground", "reference")
    assert mask.share < 0.3
    assert open_city.error_px(result.transform) < 2


@pytest.mark.slow
def test_either_image_may_be_the_radars(open_city: SimulatedFiles) -> None:
    mask = register_specified(COREGISTER, open_city.input, open_city.reference).mask
    assert (mask.kind, mask.image) == ("ground", "input")


@pytest.fixture(scope="module")
def filtered(city: SimulatedFiles) -> Path:
    """Return the city's radar image without its speckle.

    Matched whole, its buildings agree 3.9 px off the ground.
    """
    path = city.folder / "filtered.tif"
    filter_speckle(city.reference, path)
    return path


@pytest.mark.slow
def test_a_city_without_speckle_is_refused(open_city: SimulatedFiles, tmp_path: Path) -> None:
    """Nothing but the filter's tag tells that it is a radar's."""
    filtered, report = tmp_path / "filtered.tif", tmp_path / "report.html"
    filter_speckle(open_city.reference, filtered)
    with pytest.raises(NotRegisteredError, match="has no speckle"):
        coregister(filtered, open_city.input, tmp_path / "out.tif", report=report)
    told = json.loads(report.with_suffix(".json").read_text())
    assert (told["mask"]["kind"], told["mask"]["image"]) == ("ground", "reference")


@pytest.mark.slow
def test_where_nothing_tells_the_radar_few_who_agree_are_not_enough(
    city: SimulatedFiles, filtered: Path, tmp_path: Path
) -> None:
    """As software leaves it that writes no tag."""
    bare, report = tmp_path / "bare.tif", tmp_path / "report.html"
    with rasterio.open(filtered) as source:
        write_raster(bare, source.read(), crs=source.crs, transform=source.transform)
    with pytest.raises(NotRegisteredError):
        coregister(bare, city.input, tmp_path / "out.tif", report=report)
    assert not (tmp_path / "out.tif").exists()
    told = json.loads(report.with_suffix(".json").read_text())
    # Both rules apply: what heights may displace, and the few who agree.
    assert told["verdict"]["rule"] in ("uncertain transform", "town matched whole")
    assert told["mask"]["kind"] == "none"


@pytest.mark.slow
@pytest.mark.parametrize("tool", [coregister, match_optical])
def test_a_mask_that_leaves_a_fifth_counts_on_either_image(tool: Callable[..., Any]) -> None:
    """Scattered areas, as between clouds: chips meet as much of the one image as of the other."""
    size, edge, (right, down) = 500, 20, (5, -3)
    place, rng = Affine(10, 0, 5e5, 0, -10, 5e6), np.random.default_rng(2)
    ground = 100 + 60 * gaussian_filter(rng.normal(size=(size + 2 * edge,) * 2), 1.5)
    images = []
    for col, row in ((0, 0), (right, down)):
        part = ground[edge + row : edge + row + size, edge + col : edge + col + size]
        noisy = part + rng.normal(0, 5, part.shape)
        images.append(Raster(noisy.astype(np.float32), place, "EPSG:32632"))
    cover = gaussian_filter(rng.normal(size=(size, size)), 5)
    mask = Raster((cover > np.quantile(cover, 0.8)).astype(np.uint8), place, "EPSG:32632")
    for name in ("reference_mask", "input_mask"):
        with tool(*images, **{name: mask}) as found:
            xy = found.pair.grid.pixel_to_map(found.pair.grid.places())
            px = found.pair.reference.source.grid.map_to_pixel(xy)
            assert np.abs(found.transform(xy) - (px - [right, down])).max() < 0.3
            assert found.survey.confirming > 0.9 * len(found.survey.centres)


@pytest.mark.slow
@pytest.mark.parametrize("where", ["reference", "input"])
def test_a_fifth_of_either_image_of_a_real_pair_is_enough(
    real_data: Path, tmp_path: Path, where: str
) -> None:
    (case,) = (case for case in read_cases(real_data) if case.name == "oo-lakes")
    pair = write_case(case, draw_shift(case, 20.0, 0), tmp_path)
    with open_raster(getattr(pair, where)) as source:
        grid = source.grid
    cover = gaussian_filter(np.random.default_rng(3).normal(size=grid.size[::-1]), 8)
    mask = Raster((cover > np.quantile(cover, 0.8)).astype(np.uint8), grid.transform, grid.crs)
    masks = {f"{where}_mask": mask}
    with coregister(
        pair.reference, pair.input, search_radius=search_radius_m(20.0), **masks
    ) as one:
        assert pair.truth is not None
        assert pair.truth.error_px(on_pixels(one.transform, pair.reference)) < 1.0
