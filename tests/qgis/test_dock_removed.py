"""The dock where layers, files, runs or the dock itself go: nothing else goes with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from desktops import Desktop, open_registered, pair
from rpc_scenes import make_scene


def test_layers_that_go_leave_nothing_behind(
    desktop: Desktop, tmp_path: Path, registered_files: dict[str, Path]
) -> None:
    from qgis.core import QgsProject

    dock = open_registered(tmp_path, desktop, registered_files)
    dock.look.swipe.click()
    assert dock.repair.table.rowCount() > 0
    QgsProject.instance().clear()
    assert not dock.overlay.isVisible()
    assert not dock.look._beneath.isVisible()
    assert dock.repair.review is None
    assert dock.repair.table.rowCount() == 0
    assert dock.repair.model.count() == 0
    assert not dock.look.swipe.isEnabled()
    assert not dock.look.next.isEnabled()


def test_layers_of_others_that_go_take_nothing_with_them(
    desktop: Desktop, tmp_path: Path, registered_files: dict[str, Path]
) -> None:
    """A person's edits are not lost with a layer that has no part in them."""
    from qgis.core import QgsProject, QgsVectorLayer

    dock = open_registered(tmp_path, desktop, registered_files)
    repair, project = dock.repair, QgsProject.instance()
    repair.change(repair.review.switch([0], False))
    other = QgsVectorLayer("Point?crs=EPSG:32633", "other", "memory")
    project.addMapLayer(other)
    project.removeMapLayer(other.id())
    assert not repair.review.points.used[0]
    assert dock.look.swipe.isEnabled()
    # Without the registered image there is nothing to look at; the points can be written anew.
    project.removeMapLayer(dock.look._registered.id())
    assert not dock.look.swipe.isEnabled()
    assert not repair.review.points.used[0]
    assert repair.write.isEnabled()
    project.removeMapLayer(repair._input.id())
    assert repair.review is None
    assert not repair.write.isEnabled()


def test_layers_that_go_during_a_run_do_no_harm(desktop: Desktop, tmp_path: Path) -> None:
    from qgis.core import QgsProject

    pair(tmp_path, desktop)
    start = desktop.open().start
    start.register.click()
    QgsProject.instance().clear()
    start.register.click()  # it is Cancel now
    desktop.wait(lambda: start._run is None)
    assert "Not registered" in start.verdict.text()
    assert not desktop.dock.look.swipe.isEnabled()


def test_the_dock_opens_beside_a_layer_whose_file_is_gone(desktop: Desktop, tmp_path: Path) -> None:
    """Also where another plugin has GDAL raise errors."""
    from osgeo import gdal
    from qgis.core import QgsProject, QgsRasterLayer

    gone = QgsRasterLayer(str(tmp_path / "gone.tif"), "gone")
    QgsProject.instance().addMapLayer(gone)
    raised = gdal.GetUseExceptions()
    gdal.UseExceptions()
    try:
        assert desktop.dock is None
        desktop.dock = desktop._dock(desktop.iface)
    finally:
        if not raised:
            gdal.DontUseExceptions()
    assert desktop.dock.start.heights.isHidden()


@pytest.mark.parametrize("name", ["dem", "image"])
def test_layers_that_go_while_rpcs_are_refined(
    desktop: Desktop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    from groundtie_qgis import sensor_run
    from groundtie_qgis.run import Outcome, Run
    from qgis.core import QgsProject

    refining: list[Any] = []

    class Refining(Run):
        def start(self) -> None:
            if refining:  # What comes next is the orthoimage, of a layer that is gone.
                super().start()
            refining.append(self)

    monkeypatch.setattr(sensor_run, "Run", Refining)
    make_scene(tmp_path, None)
    reference, image, dem = desktop.load(tmp_path, "reference", "image", "dem")
    start = desktop.open().start
    start.reference.setLayer(reference)
    start.input.setLayer(image)
    start.dem.setLayer(dem)
    start.register.click()
    (first,) = refining
    first._files["REPORT"].write_text("refined", encoding="utf-8")
    QgsProject.instance().removeMapLayer({"dem": dem, "image": image}[name].id())
    first._done(Outcome(True, files=first._files))
    assert start._run is None
    assert start.register.text() == "Register"
    assert "Not registered" in start.verdict.text()


def test_layers_that_go_after_a_refusal_do_no_harm(
    desktop: Desktop, tmp_path: Path, asked: list[tuple[str, dict[str, Any]]]
) -> None:
    from qgis.core import QgsProject

    pair(tmp_path, desktop)
    start = desktop.open().start
    desktop.register()
    QgsProject.instance().clear()
    start.choose_bands()
    assert start.bands.isVisible()


def test_a_refusal_takes_no_edited_points_away(
    desktop: Desktop,
    tmp_path: Path,
    registered_files: dict[str, Path],
    asked: list[tuple[str, dict[str, Any]]],
) -> None:
    dock = open_registered(tmp_path, desktop, registered_files)
    repair, start = dock.repair, dock.start
    repair.change(repair.review.switch([0], False))
    start.reference.setLayer(repair._reference)
    start.input.setLayer(repair._input)
    desktop.wait(lambda: not start._apart.isActive())
    desktop.register()
    assert asked
    assert not repair.review.points.used[0]
    assert repair.write.isEnabled()


def test_a_run_that_is_cancelled_changes_nothing(
    desktop: Desktop, tmp_path: Path, registered_files: dict[str, Path]
) -> None:
    dock = open_registered(tmp_path, desktop, registered_files)
    shown = dock.look._registered
    dock.start.register.click()
    dock.start.register.click()  # it is Cancel now
    desktop.wait(lambda: dock.start._run is None)
    assert "cancelled" in dock.start.verdict.text()
    assert dock.look._registered is shown
    assert dock.look.swipe.isEnabled()
    assert len(dock.repair.review.points) > 0


def test_what_is_unloaded_leaves_nothing_behind(
    desktop: Desktop, tmp_path: Path, registered_files: dict[str, Path]
) -> None:
    from qgis.PyQt.QtWidgets import QShortcut

    dock = open_registered(tmp_path, desktop, registered_files)
    dock.repair.drag.click()
    dock.repair.write.click()
    dock.start.register.click()
    dock.take_away()
    desktop.dock = None
    assert desktop.canvas.mapTool() is None
    assert desktop.canvas.findChildren(QShortcut) == []
    desktop.wait(lambda: dock.start._run is dock.repair.writer.run is None)
    assert "cancelled" in dock.start.outcome.reason
    assert "cancelled" in dock.repair.writer.outcome.reason
