"""The models that the plugin ships: they are what the script makes, and they run."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import rasterio
from rpc_scenes import SIZE, make_scene
from speckled_pairs import write_speckled_pair
from textured_pairs import TexturedPair, pixels, shift_on_map

import groundtie
from groundtie.sensor.bias import Bias
from groundtie.sensor.rpc_files import read_rpc
from scripts import make_models

ROOT = Path(__file__).resolve().parents[2]
NAMES = [recipe.name for recipe in make_models.recipes()]


@pytest.fixture(scope="module")
def speckled(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    """Two radar images of one scene."""
    folder = tmp_path_factory.mktemp("speckled")
    return write_speckled_pair(folder, (300, 280), shift_on_map(70.0, -45.0))


def run(provider: Any, name: str, values: dict[str, Any]) -> dict[str, Any]:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    context, feedback = QgsProcessingContext(), QgsProcessingFeedback()
    model = provider.algorithm(name).create()
    given = {key: str(v) if isinstance(v, Path) else v for key, v in values.items()}
    assert model.checkParameterValues(given, context) == (True, "")
    results, finished = model.run(given, context, feedback)
    assert finished, feedback.textLog()
    children: dict[str, Any] = results["CHILD_RESULTS"]
    return children


def test_what_is_shipped_is_what_the_script_makes(provider: Any, tmp_path: Path) -> None:
    from qgis.core import Qgis

    if Qgis.versionInt() >= 32_300:
        pytest.skip("newer versions write models in another form; the shipped ones are of 3.22")
    made = {path.name: path for path in make_models.write(tmp_path)}
    shipped = {path.name: path for path in make_models.FOLDER.iterdir()}
    assert set(made) == set(shipped)
    for name, path in shipped.items():
        one, other = (canonical(file) for file in (path, made[name]))
        assert one == other, f"run scripts/make_models.py: {name}"


def canonical(path: Path) -> str:
    """Return a file of Qt's XML, whose attributes come in any order, in one form.

    Texts of the tools are left out: QGIS makes outputs anew from the tools when it reads a model.
    """
    text = path.read_text(encoding="utf-8")
    root = ElementTree.fromstring(text.partition("\n")[2])
    for option in root.iter("Option"):
        if option.get("name") in ("help", "description"):
            option.attrib.pop("value", None)
    return ElementTree.canonicalize(ElementTree.tostring(root, encoding="unicode"))


@pytest.mark.parametrize("name", NAMES)
def test_models_are_offered_with_title_help_and_their_tools(provider: Any, name: str) -> None:
    model = provider.algorithm(name)
    assert model.displayName() != name
    assert model.group() == "Models"
    assert model.canExecute() == (True, "")
    assert model.helpUrl().endswith("help/models.html")
    assert model.create().displayName() == model.displayName()
    assert model.shortDescription().endswith(".")
    steps = model.create().childAlgorithms().values()
    offered = {algorithm.id() for algorithm in provider.algorithms()}
    assert {step.algorithmId() for step in steps} <= offered


def test_the_page_of_models_names_them_all(provider: Any) -> None:
    page = (ROOT / "docs/models.md").read_text(encoding="utf-8")
    for name in NAMES:
        assert provider.algorithm(name).displayName() in page


def test_an_optical_image_is_registered_by_the_ground(provider: Any, tmp_path: Path) -> None:
    groundtie.simulate(tmp_path, size=400, density="rural", looks=4, seed=1)
    found = run(
        provider,
        "sar_optical_by_the_ground",
        {
            "reference": tmp_path / "reference.tif",
            "input": tmp_path / "input.tif",
            "radius": 20,
            "mask_regions:Ground": tmp_path / "ground.tif",
            "coregister:Registered image": tmp_path / "registered.tif",
        },
    )
    with rasterio.open(tmp_path / "ground.tif") as ground:
        assert (ground.read(1) > 0).mean() == pytest.approx(found["mask_regions"]["SHARE"])
    # It lies where the exact transform puts it, and not where it lay.
    files = {
        name: tmp_path / f"{name}.tif" for name in ("reference", "input", "true", "registered")
    }
    groundtie.warp(
        files["input"], files["true"], tmp_path / "truth.json", reference=files["reference"]
    )
    inner = np.s_[0, 60:-60, 60:-60]
    registered, true, before = (
        pixels(files[name])[inner].ravel() for name in ("registered", "true", "input")
    )
    assert np.corrcoef(registered, true)[0, 1] > 0.95
    assert np.corrcoef(before, true)[0, 1] < 0.7


def test_another_raster_of_the_scene_gets_the_same_transform(
    qgis_process: Any, speckled: TexturedPair, tmp_path: Path
) -> None:
    called = qgis_process(
        *("run", "groundtie:sar_sar_and_other_rasters", "--", f"reference={speckled.reference}"),
        *(f"input={speckled.input}", f"other={speckled.input}"),
        f"match_sar_sar:Registered image={tmp_path / 'a.tif'}",
        f"match_sar_sar:Transform={tmp_path / 't.json'}",
        f"warp:Other raster, registered={tmp_path / 'b.tif'}",
    )
    # QGIS tries whether the transform is a layer, and goes on
    tries = ("ERROR 4: `", "ERROR: Status 3: Unable to load mesh", "Logged warning: ")
    assert [line for line in called.stderr.splitlines() if not line.startswith(tries)] == []
    assert called.returncode == 0
    # the same image by the same transform onto the same grid
    with rasterio.open(tmp_path / "a.tif") as one, rasterio.open(tmp_path / "b.tif") as other:
        assert one.profile == other.profile
        np.testing.assert_array_equal(one.read(), other.read())


def test_a_series_is_registered_to_its_reference(
    provider: Any, speckled: TexturedPair, tmp_path: Path
) -> None:
    found = run(
        provider,
        "series_to_reference",
        {
            "reference": speckled.reference,
            "dates": [str(speckled.input)],
            "radius": 150,
            "coregister_series:Folder of the registered images": tmp_path / "series",
        },
    )
    assert found["coregister_series"]["REGISTERED"] == 1
    assert (tmp_path / "series" / "series.csv").is_file()


def test_rpcs_are_refined_and_the_image_is_orthorectified(provider: Any, tmp_path: Path) -> None:
    bias = Bias("shift", SIZE, np.array([[-6.0, 5.0]]), np.zeros((2, 2)))
    scene = make_scene(tmp_path, bias)
    assert scene.error_px(scene.delivered) > 5
    found = run(
        provider,
        "rpcs_to_orthoimage",
        {
            "image": scene.image,
            "reference": scene.reference,
            "dem": scene.dem,
            "datum": "ellipsoidal",
            "radius": 15,
            "extract_gcps:Ground control": tmp_path / "gcps.gpkg",
            "refine_rpc:Refined RPCs": tmp_path / "refined_RPC.TXT",
            "orthorectify:Orthoimage": tmp_path / "ortho.tif",
            "assess:Assessment": tmp_path / "assessment.html",
        },
    )
    assert found["extract_gcps"]["POINTS"] > 10
    assert scene.error_px(read_rpc(tmp_path / "refined_RPC.TXT")) < 0.6
    with rasterio.open(tmp_path / "ortho.tif") as ortho, rasterio.open(scene.reference) as wanted:
        assert (ortho.transform, ortho.shape) == (wanted.transform, wanted.shape)
    assert "swipe" in (tmp_path / "assessment.html").read_text(encoding="utf-8").lower()
