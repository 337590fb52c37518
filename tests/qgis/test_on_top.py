"""Tie points lie on top of the registered image, and both on top of the map, in every run."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from noise_pairs import write_pair


@pytest.mark.parametrize("is_raster_first", [True, False])
@pytest.mark.parametrize("is_below_selected", [True, False])
def test_points_lie_on_top(
    provider: Any, tmp_path: Path, is_raster_first: bool, is_below_selected: bool
) -> None:
    """QGIS loads a run's layers in the order of their files' names, which are temporary ones.

    It adds new layers where a group is selected, which may be below all other layers.
    """
    from groundtie_qgis.run import Outcome, Run, new_file
    from qgis.core import QgsApplication, QgsLayerTreeRegistryBridge, QgsProject, QgsRasterLayer

    write_pair(tmp_path, 0, 192)
    project = QgsProject.instance()
    root, bridge = project.layerTreeRoot(), project.layerTreeRegistryBridge()
    images = [str(tmp_path / f"{name}.tif") for name in ("reference", "input")]
    values = {"MODEL": "translation", "SEARCH_RADIUS": 12}
    values |= dict(zip(("REFERENCE", "INPUT"), images, strict=True))
    project.clear()
    for path in images:
        project.addMapLayer(QgsRasterLayer(path, Path(path).stem))
    selected = root.addGroup("below") if is_below_selected else root
    bridge.setLayerInsertionPoint(QgsLayerTreeRegistryBridge.InsertionPoint(selected, 0))
    output, points = new_file("registered.tif"), new_file("points.gpkg")
    while (str(output) < str(points)) is not is_raster_first:
        points = new_file("points.gpkg")
        output = new_file("registered.tif")
    files = {"OUTPUT": output, "TIE_POINTS": points}
    done: list[Outcome] = []
    run = Run("coregister", values, files, (*files,), done.append, lambda _: None)
    run.start()
    while not done:
        QgsApplication.processEvents()
        time.sleep(0.01)
    assert done[0].succeeded, done[0].reason
    names = [layer.name() for layer in root.layerOrder()]
    # The group goes with the project.
    bridge.setLayerInsertionPoint(QgsLayerTreeRegistryBridge.InsertionPoint(root, 0))
    project.clear()
    assert names[:2] == ["Tie points", "Registered image"]
