"""The dock's whole way: start, verdict, look, drag a point, write; and what goes wrong on it.

Pictures of every step are left in the folder that GROUNDTIE_PICTURES names.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.transform
from desktops import Desktop, drag, open_registered, pair
from noise_pairs import ORIGIN, write_pair, write_raster
from rpc_scenes import SIZE, Scene, make_scene

from groundtie.sensor.bias import Bias
from groundtie.sensor.rpc_files import read_rpc, write_rpc


def test_the_boxes_never_hold_one_layer(desktop: Desktop, tmp_path: Path) -> None:
    reference, input = pair(tmp_path, desktop)
    start = desktop.open().start
    for box, layer in (
        (start.reference, input),
        (start.reference, reference),
        (start.input, reference),
        (start.input, input),
    ):
        box.setLayer(layer)
        desktop.wait(lambda: not start._apart.isActive())
        assert {start.reference.currentLayer(), start.input.currentLayer()} == {reference, input}


def test_from_two_layers_to_a_reviewed_image(desktop: Desktop, tmp_path: Path) -> None:
    """README's minute: the button that opens the dock, *Register*, *Look*, *Swipe*: four clicks."""
    readme = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
    minute = readme.partition("## One minute in QGIS")[2].partition("##")[0]
    clicks = ("Raster → GroundTie → Register and review", "Register", "Look", "Swipe")
    assert [word for word in clicks if f"*{word}*" not in minute] == []
    from qgis.core import QgsProject

    pair(tmp_path, desktop)
    dock = desktop.open()
    desktop.picture("1_start")
    outcome = desktop.register()
    assert outcome.succeeded, outcome.reason
    assert "Accepted" in dock.start.verdict.text()
    assert "<p>correction: 5.0 px (5.0 m)" in dock.start.verdict.text()
    assert outcome.lines[0].startswith("correction: ")  # Steps are no results.
    assert dock.start.report.isVisible()
    assert not dock.start.tries.wider.isVisible()
    desktop.picture("2_verdict")
    names = [layer.name() for layer in QgsProject.instance().layerTreeRoot().layerOrder()]
    assert names[0] == "Registered image"

    dock.tabs.setCurrentWidget(dock.look)
    dock.look.swipe.click()
    desktop.wait(lambda: not dock.overlay._image.isNull(), 0.3)
    assert dock.overlay.share == 0.5
    desktop.picture("3_swipe")
    dock.look.swipe.click()
    assert not dock.overlay.isVisible()


@pytest.mark.parametrize("way", ["options", "archive"])
def test_layers_of_archives_and_with_options(desktop: Desktop, tmp_path: Path, way: str) -> None:
    from groundtie_qgis import search
    from qgis.core import QgsProject, QgsRasterLayer

    write_pair(tmp_path, 0)
    archive = tmp_path / "a pair ö.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for name in ("reference", "input"):
            file.write(tmp_path / f"{name}.tif", f"b/{name}.tif")
    place = {"options": f"{tmp_path}/{{}}.tif|option:NUM_THREADS=2"}.get(
        way, f"/vsizip/{archive}/b/{{}}.tif"
    )
    layers = [QgsRasterLayer(place.format(name), name) for name in ("reference", "input")]
    for layer in layers:
        QgsProject.instance().addMapLayer(layer)
    desktop.canvas.setExtent(layers[0].extent())
    dock = desktop.open()
    assert search.usual_radius_m("register", *layers) == 100
    dock.start.pair.setCurrentIndex(dock.start.pair.findData("coregister"))
    dock.start.radius.setValue(12)
    outcome = desktop.register()
    assert outcome.succeeded, outcome.reason
    repair = dock.repair
    assert len(repair.review.points) > 0, repair.text.text()
    count = len(repair.review.points)
    repair.add_point(repair.review.points.reference_xy[0], repair.review.points.input_px[0])
    assert len(repair.review.points) == count + 1
    assert repair.review.points.score[-1] > 5


def test_looking_goes_from_place_to_place(
    desktop: Desktop, tmp_path: Path, registered_files: dict[str, Path]
) -> None:
    dock = open_registered(tmp_path, desktop, registered_files)
    worst = dock.repair.review.worst(dock.repair.fits[dock.repair.kind()].residuals_px)
    for step in (0, 1):
        dock.look.next.click()
        centre = desktop.canvas.extent().center()
        place = dock.repair.review.points.reference_xy[worst[step]]
        np.testing.assert_allclose([centre.x(), centre.y()], place, atol=1)
    dock.look.previous.click()
    centre = desktop.canvas.extent().center()
    place = dock.repair.review.points.reference_xy[worst[0]]
    np.testing.assert_allclose([centre.x(), centre.y()], place, atol=1)
    # Full resolution: a pixel of the reference is a pixel of the screen or larger.
    pixel = dock.look._reference.rasterUnitsPerPixelX()
    assert desktop.canvas.mapUnitsPerPixel() < 2 * pixel
    dock.look.corners[0].click()
    centre = desktop.canvas.extent().center()
    assert centre.x() < ORIGIN[0] + 100
    assert centre.y() > ORIGIN[1] - 100
    dock.look.flicker.click()
    shares = set()
    desktop.wait(lambda: shares.add(dock.overlay.share) or shares >= {0.0, 1.0})  # type: ignore[func-returns-value]
    dock.look.flicker.click()
    assert not dock.overlay.isVisible()


def test_a_refusal_says_why_and_what_to_try(desktop: Desktop, tmp_path: Path) -> None:
    for seed, name in enumerate(("one", "other")):
        (tmp_path / name).mkdir()
        write_pair(tmp_path / name, seed)
    (reference,) = desktop.load(tmp_path / "one", "reference")
    (input,) = desktop.load(tmp_path / "other", "input")
    dock = desktop.open()
    start = dock.start
    start.pair.setCurrentText("SAR and optical")
    start.reference.setLayer(reference)
    start.input.setLayer(input)
    start.radius.setValue(12)
    outcome = desktop.register()
    assert not outcome.succeeded
    assert "input was not registered to reference: " in start.verdict.text()
    assert start.report.isVisible()
    tries = start.tries
    offered = (tries.wider, tries.turn, tries.bands)
    assert [button.text() for button in offered if not button.isVisible()] == []
    assert "refused" in outcome.files["REPORT"].read_text(encoding="utf-8")
    desktop.picture("8_refused")
    assert not dock.look.swipe.isEnabled()
    # A person may begin with points of their own.
    assert len(dock.repair.review.points) == 0
    assert not dock.repair.write.isEnabled()
    tries.wider.click()
    assert start.radius.value() == 24
    start.register.click()  # it is Cancel now
    desktop.wait(lambda: start._run is None)
    assert not start.outcome.succeeded


def test_what_a_refusal_offers_is_what_is_asked_for(
    desktop: Desktop, tmp_path: Path, asked: list[tuple[str, dict[str, Any]]]
) -> None:
    random = np.random.Generator(np.random.PCG64(0))
    right = rasterio.transform.from_origin(*ORIGIN, 1, 1)
    for name, bands in (("reference", 1), ("input", 3)):
        write_raster(tmp_path / f"{name}.tif", random.uniform(1, 254, (bands, 64, 64)), right)
    desktop.load(tmp_path, "reference", "input")
    start = desktop.open().start
    tries = start.tries
    desktop.register()
    tool, values = asked.pop()
    assert tool == "register"
    assert not {"SEARCH_RADIUS", "SEARCH_ROTATION", "INPUT_BAND"} & set(values)

    assert tries.bands.isVisible()
    desktop.picture("12_what_to_try")
    tries.bands.click()
    assert start.bands.isVisible()
    start.bands.boxes["INPUT_BAND"].setBand(3)
    desktop.picture("13_other_bands")
    start.register.click()
    tool, values = asked.pop()
    assert (tool, values["INPUT_BAND"]) == ("register", 3)
    assert "REFERENCE_BAND" not in values
    assert not tries.bands.isVisible()

    tries.turn.click()
    tool, values = asked.pop()
    assert (tool, values["SEARCH_ROTATION"], values["INPUT_BAND"]) == ("coregister", 180, 3)
    assert not tries.turn.isVisible()

    # Another input: its bands are not those that were set.
    start.input.setLayer(start.reference.currentLayer())
    desktop.wait(lambda: not start._apart.isActive())
    assert start.bands.values() == {}


@pytest.mark.parametrize(
    ("tool", "pixels_m", "first"),
    [
        # Twice the larger of 100 m and 20 pixels of the coarser image.
        ("coregister", (1, 1), 200),
        ("register", (1, 30), 1200),
        ("match_optical", (10, 1), 400),
        # Without georeferencing: 20 pixels, or a quarter of the input's 64.
        ("coregister", None, 40),
        ("match_sar_sar", None, 32),
        ("register", None, 32),
    ],
)
def test_farther_is_twice_as_far_as_was_searched(
    desktop: Desktop,
    tmp_path: Path,
    asked: list[tuple[str, dict[str, Any]]],
    tool: str,
    pixels_m: tuple[int, int] | None,
    first: float,
) -> None:
    random = np.random.Generator(np.random.PCG64(0))
    for name, size in zip(("reference", "input"), pixels_m or (None, None), strict=True):
        place = None if size is None else rasterio.transform.from_origin(*ORIGIN, size, size)
        write_raster(tmp_path / f"{name}.tif", random.uniform(1, 254, (1, 64, 64)), place)
    reference, input = desktop.load(tmp_path, "reference", "input")
    start = desktop.open().start
    start.reference.setLayer(reference)
    start.input.setLayer(input)
    start.pair.setCurrentIndex(start.pair.findData(tool))
    desktop.register()
    assert "SEARCH_RADIUS" not in asked.pop()[1]
    for radius in (first, 2 * first):
        start.tries.wider.click()
        assert asked.pop()[1]["SEARCH_RADIUS"] == radius


def test_how_far_an_image_with_rpcs_is_searched(desktop: Desktop, tmp_path: Path) -> None:
    """Its own file states no size of its pixels on the ground, which is 1 m."""
    from groundtie_qgis import search

    make_scene(tmp_path, None)
    reference, image = desktop.load(tmp_path, "reference", "image")
    assert search._grid(image).pixel_size_m == pytest.approx(1, rel=0.1)
    assert search.usual_radius_m("register", reference, image) == pytest.approx(100)
    assert search.usual_radius_m("register", None, image) == 0


def test_wrong_values_are_told_at_once(desktop: Desktop) -> None:
    start = desktop.open().start
    start.register.click()
    assert "Choose two raster layers" in start.verdict.text()


@pytest.mark.parametrize("rotation_deg", [0, 30])
def test_swipe_shows_the_registered_image_whatever_lies_above_it(
    desktop: Desktop, tmp_path: Path, registered_files: dict[str, Path], rotation_deg: float
) -> None:
    dock = open_registered(tmp_path, desktop, registered_files)
    desktop.canvas.setRotation(rotation_deg)
    corner = dock.repair.points.pos()
    assert corner.manhattanLength() < 1e-6  # Points are painted in the map's pixels.
    dock.tabs.setCurrentWidget(dock.look)
    # The input lies above: its corner, where it is not registered to, is what the map shows.
    desktop.canvas.setLayers([dock.repair._input])
    dock.look.swipe.click()
    both = (dock.overlay, dock.look._beneath)
    desktop.wait(lambda: not any(item._image.isNull() for item in both), 0.5)
    dock.overlay.set_share(0.5)
    shown = desktop.canvas.viewport().grab().toImage()
    places = [(x, y) for x in range(20, shown.width(), 40) for y in range(20, shown.height(), 40)]
    for x, y in places:
        if abs(x - shown.width() / 2) > 3:
            item = both[int(x > shown.width() / 2)]
            assert shown.pixelColor(x, y) == item._image.pixelColor(x, y)
    assert [item._layers[0].source() for item in both] == [
        str(tmp_path / "reference.tif"),
        str(registered_files["OUTPUT"]),
    ]
    dock.look.swipe.click()
    assert not any(item.isVisible() for item in both)


def test_what_is_no_file_is_no_input(desktop: Desktop, tmp_path: Path) -> None:
    """A web map as the input would be drawn as a whole, the Earth, before it is refused."""
    from qgis.core import QgsProject, QgsRasterLayer

    pair(tmp_path, desktop)
    source = "type=xyz&url=file:///nowhere/{z}/{x}/{y}.png&zmin=1&zmax=16"
    QgsProject.instance().addMapLayer(QgsRasterLayer(source, "web", "wms"))
    start = desktop.open().start
    offered = {
        name: [box.itemText(index) for index in range(box.count())]
        for name, box in (
            ("reference", start.reference),
            ("input", start.input),
            ("dem", start.dem),
        )
    }
    assert {name for name, texts in offered.items() if "web" in texts} == {"reference"}


def test_the_map_stays_chosen_when_the_dock_is_shown_again(
    desktop: Desktop, tmp_path: Path
) -> None:
    dock = desktop.open()
    box = dock.start.reference
    chosen = box.currentText()
    assert chosen == "The map as it is drawn"  # There is nothing else; nobody chose it.
    pair(tmp_path, desktop)
    dock.hide()
    dock.show()
    assert box.currentText() == "reference"
    box.setCurrentIndex(box.findText(chosen))
    box.activated.emit(box.currentIndex())
    dock.hide()
    dock.show()
    assert box.currentText() == chosen


def write_exact_control(scene: Scene, path: Path) -> Path:
    """Write places of an image with RPCs where they truly are on the map."""
    from groundtie.review import of_sensor_image

    rpc = path.with_name("exact_RPC.TXT")
    write_rpc(rpc, scene.truth)
    exact = of_sensor_image(scene.reference, scene.image, rpc, scene.dem, "ellipsoidal", None)
    px = np.stack(np.meshgrid(*(np.linspace(60, side - 60, 5) for side in SIZE)), -1).reshape(-1, 2)
    table = np.hstack([exact.nominal.nominal_xy(px), px])
    names = "reference_x,reference_y,input_col,input_row"
    np.savetxt(path, table, delimiter=",", header=names, comments="")
    return path


def test_an_image_with_rpcs_from_start_to_points_set_by_hand(
    desktop: Desktop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ground control on the reference, refined RPCs, an orthoimage to look at; a point is moved.

    Matching takes long, and is tested with the models: here the control is given.
    """
    from groundtie_qgis.start_page import StartPage
    from qgis.core import QgsProject

    bias = Bias("shift", SIZE, np.array([[-6.0, 5.0]]), np.zeros((2, 2)))
    scene = make_scene(tmp_path, bias)
    control = {"GCPS": str(write_exact_control(scene, tmp_path / "exact.csv"))}
    matched = StartPage._control
    asked: list[dict[str, Any]] = []

    def given(page: Any, reference: Any) -> dict[str, Any]:
        asked.append(matched(page, reference))
        return control

    monkeypatch.setattr(StartPage, "_control", given)
    reference, image, dem = desktop.load(tmp_path, "reference", "image", "dem")
    desktop.canvas.setDestinationCrs(reference.crs())
    desktop.canvas.setExtent(reference.extent())
    dock = desktop.open()
    start, repair = dock.start, dock.repair
    start.reference.setLayer(reference)
    start.input.setLayer(image)
    desktop.wait(lambda: not start._apart.isActive())
    assert start.heights.isVisible()
    assert not start.pair.isEnabled()
    start.dem.setLayer(dem)
    start.radius.setValue(15)
    outcome = desktop.register()
    assert outcome.succeeded, outcome.reason
    assert asked == [{"REFERENCE": reference.id(), "SEARCH_RADIUS": 15.0}]
    assert "accepted: " in start.verdict.text()
    assert scene.error_px(read_rpc(outcome.files["RPC"])) < 0.6
    ortho = dock.look._registered
    assert QgsProject.instance().mapLayer(ortho.id()).extent() == reference.extent()
    desktop.picture("10_rpcs")

    dock.tabs.setCurrentWidget(repair)
    assert list(repair.fits) == ["translation", "affine"]
    desktop.picture("11_ground_control")
    used = repair.review.points.used & ~repair.review.points.is_check
    index = int(np.flatnonzero(used)[0])
    assert repair.fits["translation"].residuals_px[index] < 0.1
    repair.drag.click()
    place = repair.points.toCanvasCoordinates(repair.points.rows[index][1])
    drag(repair._drag, place, (25, 0))
    assert repair.review.points.edited[index]
    assert repair.fits["translation"].residuals_px[index] > 2
    repair.write.click()
    desktop.wait(lambda: repair.writer.run is None)
    assert repair.text.text().startswith("Written: "), repair.text.text()
    again = dock.look._registered
    assert again.id() != ortho.id()
    assert again.extent() == reference.extent()
    report = repair.writer.outcome.files["REPORT"]
    assert json.loads(report.with_suffix(".json").read_text())["points_by_hand"] == 1
    assert "Points set by hand: 1." in report.read_text(encoding="utf-8")


def test_the_menu_makes_and_loads_an_example(desktop: Desktop, tmp_path: Path) -> None:
    from groundtie_qgis.plugin import GroundTiePlugin
    from qgis.core import QgsProject

    desktop.iface.addDockWidget.side_effect = desktop.window.addDockWidget
    plugin = GroundTiePlugin(desktop.iface, tmp_path)
    desktop.window.show()
    plugin.load_example()
    plugin.load_example()  # a second click does not make a second one
    desktop.wait(lambda: plugin.dock is not None)
    layers = QgsProject.instance().mapLayers().values()
    assert sorted(layer.name() for layer in layers) == ["input", "reference"]
    assert plugin.dock.start.reference.currentLayer().name() == "reference"
    assert plugin.dock.start.input.currentLayer().name() == "input"
    shown = desktop.canvas.extent()
    assert all(shown.intersects(layer.extent()) for layer in layers)
    desktop.picture("9_example")
    plugin.unload()


def test_plugin_menu_opens_and_closes_the_dock(desktop: Desktop, tmp_path: Path) -> None:
    from groundtie_qgis.plugin import GroundTiePlugin

    iface = desktop.iface
    iface.addDockWidget.side_effect = desktop.window.addDockWidget
    plugin = GroundTiePlugin(iface, tmp_path)
    plugin.initProcessing = lambda: None
    plugin.initGui()
    iface.addToolBarIcon.assert_called_once_with(plugin.actions[0])
    desktop.window.show()
    plugin.actions[0].trigger()
    assert plugin.dock.isVisible()
    assert plugin.dock.repair.points.isVisible()
    plugin.actions[0].trigger()
    assert not plugin.dock.isVisible()
    assert not plugin.dock.repair.points.isVisible()
    plugin.unload()
    assert plugin.dock is None
    iface.removeToolBarIcon.assert_called_once()
