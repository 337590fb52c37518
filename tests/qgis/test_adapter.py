"""The algorithm made from a declaration: values, checks, results and errors, with the toy tool."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin


def write_raster(path: Path, bands: int = 1, **other: Any) -> Path:
    grid = {"transform": from_origin(500000, 5000000, 1, 1), "crs": "EPSG:32633", **other}
    with rasterio.open(path, "w", "GTiff", 20, 20, bands, dtype="uint8", **grid) as raster:
        raster.write(np.ones((bands, 20, 20), np.uint8))
    return path


@pytest.fixture
def values(tmp_path: Path) -> dict[str, Any]:
    return {
        "REFERENCE": str(write_raster(tmp_path / "a.tif")),
        "INPUT": str(write_raster(tmp_path / "b.tif", bands=3)),
        "OUTPUT": str(tmp_path / "c.tif"),
        "SIZE": 3,
    }


@pytest.fixture
def algorithm(provider: Any) -> Any:
    return provider.algorithm("toy").create()


def run(
    algorithm: Any, values: dict[str, Any], feedback: Any = None
) -> tuple[dict[str, Any], bool]:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    results, finished = algorithm.run(
        values,
        QgsProcessingContext(),
        feedback or QgsProcessingFeedback(),
        catchExceptions=False,
    )
    return dict(results), bool(finished)


def check(algorithm: Any, values: dict[str, Any]) -> tuple[bool, str]:
    from qgis.core import QgsProcessingContext, QgsProject

    context = QgsProcessingContext()
    context.setProject(QgsProject.instance())
    valid, message = algorithm.checkParameterValues(values, context)
    return bool(valid), str(message)


def called_with(algorithm: Any, values: dict[str, Any], monkeypatch: Any) -> dict[str, Any]:
    """Run the algorithm and return the values that its tool was called with."""
    seen: dict[str, Any] = {}
    tool_run = algorithm._tool.run

    def note(**given: Any) -> Any:
        seen.update(given)
        return tool_run(**given)

    monkeypatch.setitem(algorithm._tool.__dict__, "run", note)
    assert run(algorithm, values)[1]
    return seen


class TestRun:
    """Running, and what comes back."""

    def test_results_are_files_and_numbers(self, algorithm: Any, values: dict[str, Any]) -> None:
        results, finished = run(algorithm, values)
        assert finished
        assert results == {
            "OUTPUT": values["OUTPUT"],
            "CHECK_RMSE_PX": 0.25,
            "REASON": "good",
        }
        assert Path(values["OUTPUT"]).read_bytes() == b"done"

    def test_progress_and_lines_reach_the_log(self, algorithm: Any, values: dict[str, Any]) -> None:
        from qgis.core import QgsProcessingFeedback

        feedback = QgsProcessingFeedback()
        run(algorithm, values, feedback)
        assert feedback.progress() == 100
        log = feedback.textLog()
        assert log.count("half of it") == 1
        assert "accepted" in log
        assert "size 3.0" in log

    @pytest.mark.parametrize("most", [-1, 2])
    def test_threads_are_those_of_the_settings(
        self,
        algorithm: Any,
        values: dict[str, Any],
        monkeypatch: pytest.MonkeyPatch,
        most: int,
    ) -> None:
        """QGIS takes no more threads than there are processors, and 3.40 no less than two."""
        from qgis.core import QgsApplication

        before = QgsApplication.maxThreads()
        try:
            QgsApplication.setMaxThreads(most)
            stated = QgsApplication.maxThreads()
            workers = called_with(algorithm, values, monkeypatch)["workers"]
            assert workers == (stated if stated > 0 else None)
        finally:
            QgsApplication.setMaxThreads(before)

    def test_all_values_arrive(
        self,
        algorithm: Any,
        values: dict[str, Any],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        (tmp_path / "t.json").write_text("{}")
        (tmp_path / "r.geojson").write_text('{"type": "FeatureCollection", "features": []}')
        given = {
            "SEARCH_RADIUS": 12.5,
            "MODE": "work",
            "BAND": 3,
            "CAREFUL": False,
            "TITLE": "words",
            "TIE_POINTS": str(tmp_path / "p.gpkg"),
            "REPORT": str(tmp_path / "r.html"),
            "FOLDER": str(tmp_path / "more"),
            "REGIONS": str(tmp_path / "r.geojson"),
            "TRANSFORM": str(tmp_path / "t.json"),
            "MASK": str(tmp_path / "t.json"),
            "SEED": 11,
        }
        seen = called_with(algorithm, {**values, **given}, monkeypatch)
        seen.pop("progress")
        assert (seen.pop("others"), seen.pop("workers")) == (None, None)
        assert {name.upper(): _text(value) for name, value in seen.items()} == {**values, **given}

    def test_what_is_not_given_takes_the_default(
        self, algorithm: Any, values: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from qgis.core import NULL

        empty = {"SEARCH_RADIUS": None, "TITLE": "", "SEED": NULL, "REPORT": None}
        seen = called_with(algorithm, {**values, **empty}, monkeypatch)
        assert (seen["search_radius"], seen["title"], seen["seed"]) == (None, None, 7)
        assert (seen["band"], seen["careful"], seen["mode"]) == (1, True, "work")
        assert seen["report"] is None

    def test_layers_are_read_from_their_files(
        self, algorithm: Any, values: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from qgis.core import QgsRasterLayer

        layer = QgsRasterLayer(values["INPUT"], "layer")
        seen = called_with(algorithm, {**values, "INPUT": layer}, monkeypatch)
        assert seen["input"] == Path(values["INPUT"])

    @pytest.mark.parametrize("kind", ["raster", "vector", "memory"])
    def test_a_mask_may_be_any_layer(
        self,
        algorithm: Any,
        values: dict[str, Any],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        kind: str,
    ) -> None:
        from qgis.core import QgsProject, QgsRasterLayer, QgsVectorLayer

        files = {"raster": write_raster(tmp_path / "m.tif"), "vector": tmp_path / "m.geojson"}
        files["vector"].write_text('{"type": "FeatureCollection", "features": []}')
        layer = {
            "raster": lambda: QgsRasterLayer(str(files["raster"]), "mask"),
            "vector": lambda: QgsVectorLayer(str(files["vector"]), "mask"),
            "memory": lambda: QgsVectorLayer("Polygon?crs=EPSG:32633", "mask", "memory"),
        }[kind]()
        QgsProject.instance().addMapLayer(layer)
        assert check(algorithm, {**values, "MASK": layer.id()}) == (True, "")
        seen = called_with(algorithm, {**values, "MASK": layer}, monkeypatch)
        QgsProject.instance().clear()
        if kind == "memory":
            assert seen["mask"].suffix == ".gpkg"
        else:
            assert seen["mask"] == files[kind]

    @pytest.mark.parametrize("name", ["MASK", "REGIONS"])
    def test_unsaved_edits_of_shapes_count(
        self,
        algorithm: Any,
        values: dict[str, Any],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        name: str,
    ) -> None:
        from qgis.core import QgsVectorLayer

        path = tmp_path / "m.geojson"
        shapes = [
            {"type": "Polygon", "coordinates": [[[x, 0], [x + 1, 0], [x, 1]]]} for x in (3, 8)
        ]
        features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
        path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
        layer = QgsVectorLayer(str(path), "mask")
        layer.startEditing()
        layer.deleteFeature(next(layer.getFeatures()).id())
        seen = called_with(algorithm, {**values, name: layer}, monkeypatch)[name.lower()]
        (left,) = QgsVectorLayer(str(seen), "seen").getFeatures()
        assert left.geometry().boundingBox().xMinimum() == 8
        layer.rollBack()
        assert called_with(algorithm, {**values, name: layer}, monkeypatch)[name.lower()] == path

    def test_several_rasters_may_be_layers_folders_patterns_and_tables(
        self,
        algorithm: Any,
        values: dict[str, Any],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        from qgis.core import QgsProject, QgsRasterLayer

        (tmp_path / "dates.csv").write_text("file,time\na.tif,2020-01-01\n")
        (tmp_path / "item.json").write_text('{"type": "Feature", "assets": {}}')
        (tmp_path / "folder").mkdir()
        others = ["dates.csv", "item.json", "folder", "*.tif"]
        names = [str(tmp_path / name) for name in others]
        layer = QgsRasterLayer(values["INPUT"], "layer")
        QgsProject.instance().addMapLayer(layer)
        for given in (*names, *([name] for name in names), [layer.id(), *names]):
            assert check(algorithm, {**values, "OTHERS": given}) == (True, "")
        no_file = "Incorrect parameter value for OTHERS"
        for given in ("none*.tif", [""], [*names, str(tmp_path / "none.tif")]):
            assert check(algorithm, {**values, "OTHERS": given}) == (False, no_file)
        seen = called_with(algorithm, {**values, "OTHERS": [layer, *names]}, monkeypatch)
        assert seen["others"] == (Path(values["INPUT"]), *map(Path, names))
        table = called_with(algorithm, {**values, "OTHERS": names[0]}, monkeypatch)
        assert table["others"] == (Path(names[0]),)
        QgsProject.instance().clear()

    def test_names_of_gdal_stay_as_they_are(
        self, algorithm: Any, values: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        name = f"GTIFF_DIR:1:{values['INPUT']}"
        seen = called_with(algorithm, {**values, "INPUT": name}, monkeypatch)
        assert seen["input"] == name

    def test_a_temporary_output_has_a_name_of_its_own(
        self, algorithm: Any, values: dict[str, Any]
    ) -> None:
        results, _ = run(algorithm, {**values, "OUTPUT": "TEMPORARY_OUTPUT"})
        assert Path(results["OUTPUT"]).suffix == ".tif"
        assert Path(results["OUTPUT"]).read_bytes() == b"done"

    def test_it_runs_off_the_main_thread_and_reads_its_layers_in_it(
        self, algorithm: Any, values: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As in the desktop: layers may be touched only where they live."""
        import groundtie_qgis.values as reading
        from qgis.core import (
            QgsApplication,
            QgsProcessingAlgRunnerTask,
            QgsProcessingContext,
            QgsProcessingFeedback,
        )
        from qgis.PyQt.QtCore import QEventLoop, QThread

        threads: dict[str, list[bool]] = {"layers": [], "run": []}

        def noting(what: str, function: Any) -> Any:
            def noted(*given: Any, **named: Any) -> Any:
                threads[what].append(QThread.currentThread() == QgsApplication.instance().thread())
                return function(*given, **named)

            return noted

        monkeypatch.setattr(reading, "_file_of", noting("layers", reading._file_of))
        monkeypatch.setitem(algorithm._tool.__dict__, "run", noting("run", algorithm._tool.run))
        context, feedback, loop = QgsProcessingContext(), QgsProcessingFeedback(), QEventLoop()
        task = QgsProcessingAlgRunnerTask(algorithm, values, context, feedback)
        done: list[Any] = []
        task.executed.connect(lambda ok, results: (done.append((ok, dict(results))), loop.quit()))
        QgsApplication.taskManager().addTask(task)
        loop.exec_()
        assert done[0][0]
        assert done[0][1]["CHECK_RMSE_PX"] == 0.25
        assert threads["layers"] and all(threads["layers"])
        assert threads["run"] == [False]


class TestFailure:
    """What ends a run without a result."""

    def failure(self, algorithm: Any, values: dict[str, Any], feedback: Any = None) -> str:
        from qgis.core import QgsProcessingException

        with pytest.raises(QgsProcessingException) as caught:
            run(algorithm, values, feedback)
        return str(caught.value)

    def test_a_refusal_is_its_reason(self, algorithm: Any, values: dict[str, Any]) -> None:
        message = self.failure(algorithm, {**values, "MODE": "refuse"})
        assert message == "refused: too few points agree"
        assert not Path(values["OUTPUT"]).exists()

    def test_a_refusal_shows_its_report(
        self,
        algorithm: Any,
        values: dict[str, Any],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """In the desktop, whose Results Viewer lists nothing of runs that failed by itself."""
        import qgis.utils
        from processing.core.ProcessingResults import resultsList
        from qgis.core import QgsProcessingFeedback

        monkeypatch.setattr(qgis.utils, "iface", MagicMock())
        monkeypatch.setattr(resultsList, "results", [])
        feedback, report = QgsProcessingFeedback(), str(tmp_path / "r.html")
        self.failure(algorithm, {**values, "MODE": "refuse", "REPORT": report}, feedback)
        (shown,) = resultsList.getResults()
        assert (shown.name, shown.filename) == ("Toy tool: refused", report)
        assert f"report: {report}" in feedback.textLog()

    def test_layers_that_were_not_made_are_not_loaded(
        self, algorithm: Any, values: dict[str, Any]
    ) -> None:
        from qgis.core import (
            QgsProcessingContext,
            QgsProcessingException,
            QgsProcessingFeedback,
            QgsProcessingOutputLayerDefinition,
            QgsProject,
        )

        context = QgsProcessingContext()
        sink = QgsProcessingOutputLayerDefinition(values["OUTPUT"], QgsProject.instance())
        refused = {**values, "MODE": "refuse", "OUTPUT": sink}
        with pytest.raises(QgsProcessingException):
            algorithm.run(refused, context, QgsProcessingFeedback(), catchExceptions=False)
        assert not context.layersToLoadOnCompletion()

    def test_a_bug_has_its_traceback_in_the_log(
        self, algorithm: Any, values: dict[str, Any]
    ) -> None:
        from qgis.core import QgsProcessingFeedback

        feedback = QgsProcessingFeedback()
        message = self.failure(algorithm, {**values, "MODE": "crash"}, feedback)
        assert message == "this is a bug in GroundTie: ZeroDivisionError: a bug"
        assert "Traceback" in feedback.textLog()

    def test_cancel_ends_it_and_nothing_is_written(
        self, algorithm: Any, values: dict[str, Any]
    ) -> None:
        from qgis.core import QgsProcessingFeedback

        feedback = QgsProcessingFeedback()
        feedback.progressChanged.connect(lambda progress: feedback.cancel())
        message = self.failure(algorithm, {**values, "MODE": "wait"}, feedback)
        assert message == "cancelled; nothing was written"
        assert not Path(values["OUTPUT"]).exists()


class TestCheck:
    """What is refused before the run."""

    def test_good_values_pass(self, algorithm: Any, values: dict[str, Any]) -> None:
        assert check(algorithm, values) == (True, "")
        assert check(algorithm, {**values, "OUTPUT": "TEMPORARY_OUTPUT"}) == (True, "")

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"INPUT": "{REFERENCE}"}, "Input is the same raster as Reference: {REFERENCE}"),
            ({"OUTPUT": "{INPUT}"}, "Output is the same file as Input: {INPUT}"),
            ({"OUTPUT": "/no/such/c.tif"}, "the folder of Output does not exist: /no/such"),
            ({"REPORT": "/tmp/r.pdf"}, "Report must end in .html: /tmp/r.pdf"),
            ({"SIZE": 10}, "Incorrect parameter value for SIZE"),
            ({"MODE": "fly"}, "Incorrect parameter value for MODE"),
            ({"BAND": 0}, "Band must be at least 1, not 0"),
            ({"TIE_POINTS": "/tmp/p.shp"}, "Tie points must end in .gpkg or .geojson: /tmp/p.shp"),
            (
                {"INPUT": "/no/such.tif"},
                "Could not load source layer for INPUT: /no/such.tif not found",
            ),
        ],
    )
    def test_bad_values_are_named(
        self, algorithm: Any, values: dict[str, Any], change: dict[str, Any], message: str
    ) -> None:
        changed = {k: v.format(**values) if isinstance(v, str) else v for k, v in change.items()}
        expected = message.format(**values)
        assert check(algorithm, {**values, **changed}) == (False, expected)

    def test_a_layer_that_is_no_file_is_refused(
        self, algorithm: Any, values: dict[str, Any]
    ) -> None:
        from qgis.core import QgsProject, QgsRasterLayer

        layer = QgsRasterLayer("type=xyz&url=http://127.0.0.1:1/{z}/{x}/{y}.png", "Map", "wms")
        QgsProject.instance().addMapLayer(layer)
        valid, message = check(algorithm, {**values, "REFERENCE": layer.id()})
        QgsProject.instance().clear()
        assert not valid
        assert message == (
            "Reference must be a raster file, not the layer Map of the provider wms; "
            "export it to a file first"
        )

    @pytest.mark.parametrize("name", ["REFERENCE", "OTHERS", "MASK"])
    def test_a_crs_that_only_the_layer_has_is_refused(
        self, algorithm: Any, values: dict[str, Any], tmp_path: Path, name: str
    ) -> None:
        """The tool reads the file; until that has the CRS, its pixels are of unknown size."""
        from qgis.core import QgsCoordinateReferenceSystem, QgsProject, QgsRasterLayer

        path = write_raster(tmp_path / "m.tif", crs=None)
        layer = QgsRasterLayer(str(path), "Map")
        QgsProject.instance().addMapLayer(layer)
        given = {**values, name: layer.id()}
        assert check(algorithm, given) == (True, "")
        layer.setCrs(QgsCoordinateReferenceSystem("EPSG:32633"))
        assert check(algorithm, given) == (
            False,
            f"{name.capitalize()}: the layer Map has the CRS EPSG:32633, but its file, which is "
            "read, has none; assign the right one to the file (Raster > Projections > Assign "
            "Projection) and to the layer",
        )
        with rasterio.open(path, "r+") as raster:
            raster.crs = "EPSG:32633"
        assert check(algorithm, given) == (True, "")
        QgsProject.instance().clear()

    def test_a_crs_of_a_layer_without_georeferencing_says_nothing(
        self, algorithm: Any, values: dict[str, Any], tmp_path: Path
    ) -> None:
        """QGIS can be set to give the project's CRS to every layer that has none."""
        from qgis.core import QgsCoordinateReferenceSystem, QgsProject, QgsRasterLayer

        path = write_raster(tmp_path / "m.tif", crs=None, transform=None)
        layer = QgsRasterLayer(str(path), "Map")
        layer.setCrs(QgsCoordinateReferenceSystem("EPSG:32633"))
        QgsProject.instance().addMapLayer(layer)
        assert check(algorithm, {**values, "REFERENCE": layer.id()}) == (True, "")
        QgsProject.instance().clear()

    def test_a_check_has_no_layer_loaded(self, algorithm: Any, values: dict[str, Any]) -> None:
        from qgis.core import (
            QgsProcessingContext,
            QgsProcessingOutputLayerDefinition,
            QgsProject,
        )

        context = QgsProcessingContext()
        context.setProject(QgsProject.instance())
        sink = QgsProcessingOutputLayerDefinition(values["OUTPUT"], QgsProject.instance())
        assert algorithm.checkParameterValues({**values, "OUTPUT": sink}, context)[0]
        assert not context.layersToLoadOnCompletion()


def _text(value: Any) -> Any:
    return str(value) if isinstance(value, Path) else value


def test_a_batch_tells_its_failed_rows_and_goes_on(provider: Any, tmp_path: Path) -> None:
    from qgis.core import QgsProcessingFeedback

    write_raster(tmp_path / "a.tif")
    (tmp_path / "t.csv").write_text("input,mask-high-percent\na.tif,10\nnone.tif,\n")
    feedback = QgsProcessingFeedback()
    values = {"TOOL": "mask_threshold", "TABLE": str(tmp_path / "t.csv")}
    values["OUTPUT_FOLDER"] = str(tmp_path / "out")
    results, finished = run(provider.algorithm("batch").create(), values, feedback)
    assert finished
    assert (results["DONE"], results["FAILED"]) == (1, 1)
    assert results["TABLE_OF_RESULTS"] == str(tmp_path / "out/t.csv.results.csv")
    assert "row 2 (2) failed: cannot read" in feedback.textLog()
