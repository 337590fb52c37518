"""The real tools in a real QGIS: success, refusal, bad input, cancel, styles, models."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from noise_pairs import ORIGIN, POINTS, true_input_px, write_pair, write_raster

from groundtie import load_transform
from groundtie.rasters.grid import compose

ROOT = Path(__file__).resolve().parents[2]
# settings that make little work of a small pair
QUICK = ["MODEL=translation", "SEARCH_RADIUS=12"]


@pytest.fixture(scope="session")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Folders of two pairs of different places."""
    folders = [tmp_path_factory.mktemp(name) for name in ("here", "there")]
    for seed, folder in enumerate(folders):
        write_pair(folder, seed)
    return folders


def assert_registered(transform: Path) -> None:
    reference_xy = ORIGIN + np.array([[50, -50], [50, -330], [330, -50], [200, -200]])
    found = load_transform(transform)(reference_xy)
    np.testing.assert_allclose(found, true_input_px(reference_xy), atol=0.3)


def words(reference: Path, input: Path, output: Path, **more: object) -> list[str]:
    files = {"REFERENCE": reference, "INPUT": input, "OUTPUT": output, **more}
    return [f"{name}={value}" for name, value in files.items()]


def test_coregister(qgis_process: Any, pairs: list[Path], tmp_path: Path) -> None:
    reference, input = pairs[0] / "reference.tif", pairs[0] / "input.tif"
    called = qgis_process(
        *("--json", "run", "groundtie:coregister", "--", *QUICK),
        *words(reference, input, tmp_path / "o.tif", TIE_POINTS=tmp_path / "p.gpkg"),
        *(f"TRANSFORM={tmp_path / 't.json'}", f"REPORT={tmp_path / 'r.html'}"),
    )
    assert (called.returncode, called.stderr) == (0, "")
    results = json.loads(called.stdout)["results"]
    numbers = json.loads((tmp_path / "r.json").read_text())
    assert numbers["verdict"]["accepted"]
    assert results["CHECK_RMSE_PX"] == numbers["verdict"]["check_rmse_px"]
    assert {Path(results[n]).name for n in ("OUTPUT", "TIE_POINTS", "TRANSFORM", "REPORT")} == {
        "o.tif",
        "p.gpkg",
        "t.json",
        "r.html",
    }
    with rasterio.open(tmp_path / "o.tif") as made, rasterio.open(reference) as wanted:
        assert (made.shape, made.transform, made.crs) == (
            wanted.shape,
            wanted.transform,
            wanted.crs,
        )
        with rasterio.open(input) as given:
            assert (made.count, made.dtypes) == (given.count, given.dtypes)
    assert_registered(tmp_path / "t.json")


def test_simulate(qgis_process: Any, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "pair"
    called = qgis_process("run", "groundtie:simulate", "--", f"FOLDER={folder}", "SIZE=128")
    assert (called.returncode, called.stderr) == (0, "")
    for name in ("reference.tif", "input.tif"):
        with rasterio.open(folder / name) as raster:
            assert raster.shape == (128, 128)
    assert load_transform(folder / "truth.json")


@pytest.fixture(scope="session")
def truth(pairs: list[Path]) -> Path:
    """A file of the first pair's tie points without error."""
    (pairs[0] / "truth.points").write_text(POINTS)
    return pairs[0] / "truth.points"


def test_warp_makes_what_python_makes(
    qgis_process: Any, pairs: list[Path], truth: Path, tmp_path: Path
) -> None:
    import groundtie

    files = pairs[0] / "input.tif", tmp_path / "qgis.tif", truth
    called = qgis_process(
        *("run", "groundtie:warp", "--", f"INPUT={files[0]}", f"OUTPUT={files[1]}"),
        *(f"TRANSFORM={files[2]}", f"REFERENCE={pairs[0] / 'reference.tif'}"),
    )
    assert (called.returncode, called.stderr) == (0, "")
    groundtie.warp(files[0], tmp_path / "python.tif", truth, reference=pairs[0] / "reference.tif")
    with rasterio.open(files[1]) as qgis, rasterio.open(tmp_path / "python.tif") as python:
        assert qgis.profile == python.profile
        np.testing.assert_array_equal(qgis.read(), python.read())
        with rasterio.open(files[0]) as given:  # whole pixels of shift: the same values
            np.testing.assert_allclose(
                qgis.read()[:, 20:-20, 20:-20], given.read()[:, 20:-20, 20:-20], atol=1
            )


def test_images_without_georeferencing(
    qgis_process: Any, pairs: list[Path], tmp_path: Path
) -> None:
    for name in ("reference", "input"):
        with rasterio.open(pairs[0] / f"{name}.tif") as raster:
            bands = raster.read()
        write_raster(tmp_path / f"{name}.tif", bands, None)
    called = qgis_process(
        *("run", "groundtie:coregister", "--", *QUICK, f"TRANSFORM={tmp_path / 't.json'}"),
        *words(tmp_path / "reference.tif", tmp_path / "input.tif", tmp_path / "o.tif"),
    )
    assert called.returncode == 0
    assert "Warning" not in called.stderr  # QGIS itself does complain of such layers
    # pixel coordinates stand for the map: the same place is the same pixel
    px = np.array([[50.0, 60.0], [300.0, 200.0]])
    np.testing.assert_allclose(load_transform(tmp_path / "t.json")(px), px, atol=0.3)


def test_a_refusal_is_exit_code_1_with_its_reason(
    qgis_process: Any, pairs: list[Path], tmp_path: Path
) -> None:
    called = qgis_process(
        *("run", "groundtie:coregister", "--", *QUICK, f"REPORT={tmp_path / 'r.html'}"),
        *words(pairs[0] / "reference.tif", pairs[1] / "input.tif", tmp_path / "o.tif"),
    )
    assert called.returncode == 1
    assert "was not registered to" in called.stderr
    assert "Traceback" not in called.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.html", "r.json"]
    assert not json.loads((tmp_path / "r.json").read_text())["verdict"]["accepted"]


def truncated(folder: Path, pair: Path) -> Path:
    whole = (pair / "input.tif").read_bytes()
    (folder / "truncated.tif").write_bytes(whole[: len(whole) // 2])
    return folder / "truncated.tif"


def elsewhere(folder: Path, pair: Path) -> Path:
    shutil.copy(pair / "input.tif", folder / "elsewhere.tif")
    with rasterio.open(folder / "elsewhere.tif", "r+") as raster:
        raster.transform = compose(rasterio.Affine.translation(10_000, 0), raster.transform)
    return folder / "elsewhere.tif"


@pytest.mark.parametrize(
    ("make", "more", "message"),
    [
        (truncated, "", "truncated.tif"),
        (elsewhere, "", "elsewhere.tif"),
        (lambda folder, pair: pair / "input.tif", "INPUT_BAND=9", "input.tif"),
        (lambda folder, pair: pair / "reference.tif", "", "Input image is the same raster as"),
        (lambda folder, pair: folder / "no.tif", "", "no.tif"),
    ],
    ids=["truncated", "no overlap", "no such band", "same file", "no such file"],
)
def test_bad_input_is_exit_code_1_and_nothing_is_written(
    qgis_process: Any, pairs: list[Path], tmp_path: Path, make: Any, more: str, message: str
) -> None:
    inputs, outputs = tmp_path / "in", tmp_path / "out"
    inputs.mkdir()
    outputs.mkdir()
    reference = pairs[0] / "reference.tif"
    called = qgis_process(
        *("run", "groundtie:coregister", "--", *QUICK, *more.split()),
        *words(reference, make(inputs, pairs[0]), outputs / "o.tif"),
    )
    assert called.returncode == 1
    assert message in called.stderr
    assert "Traceback" not in called.stderr
    assert "bug" not in called.stderr
    assert list(outputs.iterdir()) == []


def test_cancel_leaves_nothing(provider: Any, pairs: list[Path], tmp_path: Path) -> None:
    from qgis.core import QgsProcessingContext, QgsProcessingException, QgsProcessingFeedback

    for stop_at in (0, 50, 75):
        feedback = QgsProcessingFeedback()

        def cancel(progress: float, stop_at: int = stop_at, feedback: Any = feedback) -> None:
            if progress >= stop_at:
                feedback.cancel()

        feedback.progressChanged.connect(cancel)
        values = {
            "REFERENCE": str(pairs[0] / "reference.tif"),
            "INPUT": str(pairs[0] / "input.tif"),
            "OUTPUT": str(tmp_path / "o.tif"),
            "TIE_POINTS": str(tmp_path / "p.gpkg"),
            "REPORT": str(tmp_path / "r.html"),
            **dict(word.split("=") for word in QUICK),
        }
        algorithm = provider.algorithm("coregister").create()
        with pytest.raises(QgsProcessingException, match="cancelled; nothing was written"):
            algorithm.run(values, QgsProcessingContext(), feedback, catchExceptions=False)
        assert list(tmp_path.iterdir()) == []


def test_tie_points_are_styled_when_they_are_loaded(
    provider: Any, pairs: list[Path], tmp_path: Path
) -> None:
    from qgis.core import (
        QgsProcessingContext,
        QgsProcessingFeedback,
        QgsProcessingOutputLayerDefinition,
        QgsProject,
        QgsVectorLayer,
    )

    context, feedback, project = QgsProcessingContext(), QgsProcessingFeedback(), QgsProject()
    context.setProject(project)
    sink = QgsProcessingOutputLayerDefinition(str(tmp_path / "p.gpkg"), project)
    values = {
        "REFERENCE": str(pairs[0] / "reference.tif"),
        "INPUT": str(pairs[0] / "input.tif"),
        "OUTPUT": str(tmp_path / "o.tif"),
        "TIE_POINTS": sink,
        **dict(word.split("=") for word in QUICK),
    }
    results, finished = provider.algorithm("coregister").run(values, context, feedback)
    assert finished, feedback.textLog()
    assert list(context.layersToLoadOnCompletion()) == [results["TIE_POINTS"]]
    # as the desktop does when the algorithm has ended
    layer = QgsVectorLayer(results["TIE_POINTS"], "tie points")
    assert layer.isValid() and layer.featureCount() > 5
    details = context.layerToLoadOnCompletionDetails(results["TIE_POINTS"])
    details.postProcessor().postProcessLayer(layer, context, feedback)
    renderer = layer.renderer()
    assert renderer.type() == "RuleRenderer"
    # every field that the style asks for is there
    names = {field.name() for field in layer.fields()}
    assert renderer.usedAttributes(layer_context(layer)) <= names
    assert {"role", "state", "residual_px", "score"} <= names
    assert {feature["role"] for feature in layer.getFeatures()} == {"fit", "check"}


def layer_context(layer: Any) -> Any:
    from qgis.core import QgsRenderContext

    context = QgsRenderContext()
    context.expressionContext().setFields(layer.fields())
    return context


def test_results_are_what_the_outputs_promise(
    provider: Any, pairs: list[Path], truth: Path, tmp_path: Path
) -> None:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    values = {
        "coregister": {"REFERENCE": "reference.tif", **dict(word.split("=") for word in QUICK)},
        "warp": {"TRANSFORM": truth.name},
    }
    for name, more in values.items():
        algorithm = provider.algorithm(name).create()
        files = {k: str(pairs[0] / v) if "." in v else v for k, v in more.items()}
        files |= {"INPUT": str(pairs[0] / "input.tif"), "OUTPUT": str(tmp_path / f"{name}.tif")}
        results, finished = algorithm.run(files, QgsProcessingContext(), QgsProcessingFeedback())
        assert finished
        for output in algorithm.outputDefinitions():
            types = {"outputNumber": (int, float), "outputString": str}.get(output.type())
            if types is not None:
                assert isinstance(results[output.name()], types), output.name()


PROJ_OF_QGIS = {"PROJ_LIB": "/usr/share/proj", "PROJ_DATA": "/usr/share/proj"}


def test_the_proj_of_qgis_does_no_harm(
    qgis_process: Any, pairs: list[Path], tmp_path: Path
) -> None:
    called = qgis_process(
        *("run", "groundtie:coregister", "--", *QUICK, f"TRANSFORM={tmp_path / 't.json'}"),
        *words(pairs[0] / "reference.tif", pairs[0] / "input.tif", tmp_path / "o.tif"),
        **PROJ_OF_QGIS,
    )
    assert (called.returncode, called.stderr) == (0, "")
    assert_registered(tmp_path / "t.json")
    with rasterio.open(tmp_path / "o.tif") as made:
        assert made.crs.to_epsg() == 32633


# The simulator looks its CRS up by number, for which PROJ needs its data.
IN_A_THREAD = """
import os, sys
sys.path[:0] = [{plugins!r}]
from qgis.core import *
from qgis.PyQt.QtCore import QEventLoop
app = QgsApplication([], False)
QgsApplication.initQgis()
import groundtie_qgis
plugin = groundtie_qgis.classFactory(None)
plugin.initProcessing()
context, feedback, loop, done = QgsProcessingContext(), QgsProcessingFeedback(), QEventLoop(), []
algorithm = plugin.provider.algorithm("simulate").create()
task = QgsProcessingAlgRunnerTask(algorithm, {values!r}, context, feedback)
task.executed.connect(lambda ok, results: (done.append(ok), loop.quit()))
QgsApplication.taskManager().addTask(task)
loop.exec_()
import rasterio
number = QgsCoordinateReferenceSystem("EPSG:32633").postgisSrid()
print(done, os.environ["PROJ_LIB"], number, os.path.dirname(rasterio.__file__))
print(feedback.textLog())
sys.stdout.flush()
os._exit(0)
"""


def test_a_wheel_of_rasterio_gets_along_with_the_proj_of_qgis(
    plugin_folder: Path, tmp_path: Path
) -> None:
    """As on Windows: PROJ_LIB leads to data that the PROJ in the wheel cannot read.

    Not by qgis_process: on Linux its GDAL takes the place of the one in the wheel.
    """
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    packages = ROOT / ".venv" / "lib" / version / "site-packages"
    if not (packages / "rasterio" / "proj_data").is_dir():
        pytest.skip("no .venv of this Python version with a rasterio wheel: see make install")
    values = {"FOLDER": str(tmp_path / "pair"), "SIZE": 128}
    script = IN_A_THREAD.format(plugins=str(plugin_folder), values=values)
    called = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **PROJ_OF_QGIS, "PYTHONPATH": str(packages)},
        text=True,
        capture_output=True,
        check=True,
        timeout=300,
    )
    expected = f"[True] /usr/share/proj 32633 {packages / 'rasterio'}"
    assert called.stdout.splitlines()[0] == expected, called.stdout
    with rasterio.open(tmp_path / "pair" / "reference.tif") as made:
        assert made.crs.to_epsg() == 32633
