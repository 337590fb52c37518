"""Tie points lie on top of the registered image, and both on top of the map, in every run."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from noise_pairs import write_pair

RUNS = 20


def test_points_lie_on_top_in_every_one_of_twenty_runs(provider: Any, tmp_path: Path) -> None:
    """QGIS loads a run's layers in the order of their files' names, which are temporary ones.

    Every second time a group below all other layers is selected, where QGIS adds new ones.
    """
    from groundtie_qgis.run import Outcome, Run, new_file
    from qgis.core import QgsApplication, QgsLayerTreeRegistryBridge, QgsProject, QgsRasterLayer

    write_pair(tmp_path, 0, 192)  # Twenty runs: each is short.
    project = QgsProject.instance()
    root, bridge = project.layerTreeRoot(), project.layerTreeRegistryBridge()
    images = [str(tmp_path / f"{name}.tif") for name in ("reference", "input")]
    values = {"MODEL": "translation", "SEARCH_RADIUS": 12}
    values |= dict(zip(("REFERENCE", "INPUT"), images, strict=True))
    seen, raster_first = [], []
    for number in range(RUNS):
        project.clear()
        for path in images:
            project.addMapLayer(QgsRasterLayer(path, Path(path).stem))
        selected = root.addGroup("below") if number % 2 else root
        bridge.setLayerInsertionPoint(QgsLayerTreeRegistryBridge.InsertionPoint(selected, 0))
        files = {"OUTPUT": new_file("registered.tif"), "TIE_POINTS": new_file("points.gpkg")}
        raster_first.append(str(files["OUTPUT"]) < str(files["TIE_POINTS"]))
        done: list[Outcome] = []
        run = Run("coregister", values, files, (*files,), done.append, lambda _: None)
        run.start()
        while not done:
            QgsApplication.processEvents()
            time.sleep(0.01)
        assert done[0].succeeded, done[0].reason
        seen.append([layer.name() for layer in root.layerOrder()][:2])
        # The group goes with the project.
        bridge.setLayerInsertionPoint(QgsLayerTreeRegistryBridge.InsertionPoint(root, 0))
    project.clear()
    assert len(seen) == RUNS
    assert [names for names in seen if names != ["Tie points", "Registered image"]] == []
    # Both orders came: the test would see what depends on it.
    assert 0 < sum(raster_first) < RUNS
