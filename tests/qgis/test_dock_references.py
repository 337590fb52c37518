"""What the dock registers to where there is no raster: the map, and what it is made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from desktops import Desktop, pair
from noise_pairs import ORIGIN, write_raster
from rasterio.control import GroundControlPoint
from rasterio.transform import from_origin


def test_the_map_as_it_is_drawn_may_be_the_reference(desktop: Desktop, tmp_path: Path) -> None:
    from groundtie_qgis.reference_export import with_files

    reference, input = pair(tmp_path, desktop)
    desktop.refresh()
    made, values = with_files(None, input, desktop.canvas)
    assert made.isValid()
    assert made.crs() == input.crs()
    assert values["INPUT"] == input.id()
    assert made.rasterUnitsPerPixelX() == pytest.approx(1, rel=0.01)
    assert made.extent().contains(input.extent())
    # What is drawn there is what lies there.
    with rasterio.open(made.source()) as drawn, rasterio.open(reference.source()) as ground:
        place = [(ORIGIN[0] + x + 0.5, ORIGIN[1] - y - 0.5) for x, y in ((50, 60), (200, 300))]
        there = np.array([values[0] for values in drawn.sample(place)], float)
        truth = np.array([values[0] for values in ground.sample(place)], float)
    # The stretch is linear: order and sign of differences stay.
    assert np.sign(np.diff(there)) == np.sign(np.diff(truth))


def test_where_no_layer_draws_there_is_no_ground(desktop: Desktop, tmp_path: Path) -> None:
    from groundtie_qgis.reference_export import with_files

    _, input = pair(tmp_path, desktop)
    with rasterio.open(tmp_path / "reference.tif") as whole:
        west = whole.read(window=((0, whole.height), (0, 200))).astype(float)
        write_raster(tmp_path / "west.tif", west, whole.transform)
    desktop.canvas.setLayers(desktop.load(tmp_path, "west"))
    made, _ = with_files(None, input, desktop.canvas)
    with rasterio.open(made.source()) as drawn:
        mask = drawn.dataset_mask() > 0
        first, last = (drawn.index(ORIGIN[0] + x, ORIGIN[1] - y) for x, y in ((3, 3), (197, 380)))
        assert mask[first[0] : last[0], first[1] : last[1]].all()
        assert not mask[:, drawn.index(ORIGIN[0] + 203, ORIGIN[1])[1] :].any()


def write_turned(path: Path, located_by: str) -> rasterio.Affine:
    """Write a raster turned by 30 degrees, by its grid or by points; return its grid."""
    turn = rasterio.Affine.translation(*ORIGIN) * rasterio.Affine.rotation(-30)
    grid = turn * rasterio.Affine.scale(1, -1)
    write_raster(path, np.full((1, 200, 260), 90.0), grid if located_by == "grid" else None)
    if located_by == "points":
        corners = [(0, 0), (0, 260), (200, 0), (200, 260)]
        points = [GroundControlPoint(r, c, *(grid * (c, r))) for r, c in corners]
        with rasterio.open(path, "r+") as raster:
            raster.gcps = points, "EPSG:32633"
    return grid


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
@pytest.mark.parametrize("located_by", ["grid", "points"])
def test_beside_a_turned_raster_there_is_no_ground(
    desktop: Desktop, tmp_path: Path, located_by: str
) -> None:
    from groundtie_qgis.reference_export import with_files
    from qgis.core import QgsRasterRange

    grid = write_turned(tmp_path / "turned.tif", located_by)
    write_raster(tmp_path / "input.tif", np.ones((1, 200, 200)), from_origin(*ORIGIN, 1, 1))
    turned, input = desktop.load(tmp_path, "turned", "input")
    desktop.canvas.setLayers([turned])
    made, _ = with_files(None, input, desktop.canvas)
    with rasterio.open(made.source()) as drawn:
        mask = drawn.dataset_mask() > 0
        rows, columns = np.indices(mask.shape) + 0.5
        across, down = ~grid * drawn.transform * (columns, rows)
    # by how many pixels a place lies within the raster
    depth = np.minimum(np.minimum(across, 260 - across), np.minimum(down, 200 - down))
    assert mask[depth > 1.5].all() and (depth > 1.5).sum() > 10_000
    assert not mask[depth < -1.5].any() and (depth < -1.5).sum() > 10_000
    # What the layer hides of its file stays hidden, and the layer itself is as it was.
    turned.dataProvider().setUserNoDataValue(1, [QgsRasterRange(90, 90)])
    made, _ = with_files(None, input, desktop.canvas)
    with rasterio.open(made.source()) as drawn:
        assert not drawn.dataset_mask().any()
    assert turned.source() == str(tmp_path / "turned.tif")


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
def test_a_raster_with_too_few_points_to_turn_it_is_drawn_as_it_is(
    desktop: Desktop, tmp_path: Path
) -> None:
    from groundtie_qgis.reference_export import with_files

    write_raster(tmp_path / "one.tif", np.full((1, 20, 20), 90.0), None)
    with rasterio.open(tmp_path / "one.tif", "r+") as raster:
        raster.gcps = [GroundControlPoint(0, 0, *ORIGIN)], "EPSG:32633"
    reference, input = pair(tmp_path, desktop)
    desktop.canvas.setLayers([*desktop.load(tmp_path, "one"), reference])
    made, _ = with_files(None, input, desktop.canvas)
    with rasterio.open(made.source()) as drawn:
        row, column = drawn.index(ORIGIN[0] + 100, ORIGIN[1] - 100)
        assert drawn.dataset_mask()[row, column]


def test_the_map_shows_nothing_of_the_input(
    desktop: Desktop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither in another layer, nor registered, nor what it was made from, step by step."""
    from groundtie_qgis import reference_export
    from groundtie_qgis.run import Run
    from qgis.core import QgsProject

    reference, input = pair(tmp_path, desktop)
    start = desktop.open().start
    start.pair.setCurrentIndex(start.pair.findData("coregister"))
    start.radius.setValue(12)
    assert desktop.register().succeeded
    desktop.load(tmp_path, "input")
    assert len(QgsProject.instance().mapLayers()) == 4
    desktop.refresh()
    drawn: list[Any] = []
    monkeypatch.setattr(
        reference_export, "drawn", lambda layers, *_: [drawn.extend(layers), reference][1]
    )
    reference_export.with_files(None, input, desktop.canvas)
    assert drawn == [reference]
    registered = start.outcome.files["OUTPUT"]
    filtered = tmp_path / "filtered.tif"
    values = {"INPUT": reference_export.layer_of(registered).id(), "OUTPUT": str(filtered)}
    done: list[Any] = []
    Run("filter_speckle", values, {"OUTPUT": filtered}, ("OUTPUT",), done.append, print).start()
    desktop.wait(lambda: bool(done))
    assert done[0].succeeded, done[0].reason
    assert len(QgsProject.instance().mapLayers()) == 5
    desktop.refresh()
    for layer in (input, reference_export.layer_of(registered)):
        drawn.clear()
        reference_export.with_files(None, layer, desktop.canvas)
        assert drawn == [reference]


ZOOM, TILES = 16, 3


def write_tiles(folder: Path, centre: tuple[float, float]) -> tuple[int, int]:
    """Write a web map's tiles around a place in EPSG:3857: red grows by 1 a column, green a row.

    Returns the column and row of the whole map, in pixels, at which they begin.
    """
    side = 2 * np.pi * 6378137 / 2**ZOOM
    middle = np.array([centre[0], -centre[1]]) / side + 2 ** (ZOOM - 1)
    first = np.floor(middle).astype(int) - TILES // 2
    for x in range(first[0], first[0] + TILES):
        for y in range(first[1], first[1] + TILES):
            columns, rows = (
                np.arange(256) + 256 * (n - f) for n, f in zip((x, y), first, strict=True)
            )
            bands = np.zeros((3, 256, 256), "uint8")
            bands[0], bands[1] = (columns % 250)[None], (rows % 250)[:, None]
            path = folder / str(ZOOM) / str(x) / f"{y}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            profile = {"driver": "PNG", "dtype": "uint8", "count": 3, "width": 256, "height": 256}
            with rasterio.open(path, "w", **profile) as tile:
                tile.write(bands)
    return int(256 * first[0]), int(256 * first[1])


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
def test_a_web_map_may_be_the_reference(desktop: Desktop, tmp_path: Path) -> None:
    """Its tiles are drawn where they lie, over the input's extent with the input's pixel size."""
    from groundtie_qgis.reference_export import with_files
    from qgis.core import QgsProject, QgsRasterLayer
    from rasterio.warp import transform

    _, input = pair(tmp_path, desktop)
    xy = np.array(
        [(ORIGIN[0] + x + 0.5, ORIGIN[1] - y - 0.5) for x in (40, 300) for y in (60, 200)]
    )
    mercator = np.transpose(transform("EPSG:32633", "EPSG:3857", *xy.T))
    begins = write_tiles(tmp_path / "tiles", tuple(mercator[0]))
    source = f"type=xyz&url=file://{tmp_path}/tiles/{{z}}/{{x}}/{{y}}.png&zmin={ZOOM}&zmax={ZOOM}"
    tiles = QgsRasterLayer(source, "web", "wms")
    assert tiles.isValid()
    QgsProject.instance().addMapLayer(tiles)
    made, values = with_files(tiles, input, desktop.canvas)
    assert values == {"REFERENCE": made.source(), "INPUT": input.id()}
    assert made.extent().contains(input.extent())
    assert made.rasterUnitsPerPixelX() == pytest.approx(1, rel=0.01)
    pixel = 2 * np.pi * 6378137 / 2**ZOOM / 256
    truth = mercator * [1, -1] / pixel + 2 ** (ZOOM - 1) * 256 - begins - 0.5
    with rasterio.open(made.source()) as drawn:
        seen = np.array([values[:2] for values in drawn.sample(xy)], float)
    away = (truth % 250 > 5) & (truth % 250 < 245)  # from where the colours begin anew
    assert away.sum() >= 6
    np.testing.assert_allclose(seen[away], (truth % 250)[away], atol=1.5)
