"""Where a Python package is missing, one line names it, and the provider still loads."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

HIDE = "import sys\nsys.modules['cv2'] = None\n"
COMPLAINT = (
    "GroundTie needs the Python package opencv-python-headless, which QGIS's Python does not "
    "have; install with: "
)


@pytest.fixture
def provider_without(plugin: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that makes a provider where a module is missing."""
    from groundtie_qgis.provider import GroundTieProvider

    made = []

    def make(module: str) -> Any:
        monkeypatch.setitem(sys.modules, module, None)
        provider = GroundTieProvider()
        made.append(provider)  # its algorithms live as long as it does
        provider.refreshAlgorithms()
        return provider

    return make


def test_nothing_is_missing_here(plugin: Any) -> None:
    from groundtie_qgis.dependencies import complaint, missing_packages

    assert missing_packages() == []
    assert complaint() == ""


def test_the_provider_loads_and_names_what_is_missing(provider_without: Any) -> None:
    provider = provider_without("cv2")
    names = {algorithm.name() for algorithm in provider.algorithms()}
    assert names >= {"coregister", "warp", "simulate"}
    assert provider.warningMessage().startswith(COMPLAINT)
    assert "\n" not in provider.warningMessage()
    assert provider.supportedOutputRasterLayerExtensions()
    assert provider.supportedOutputVectorLayerExtensions()


def test_the_algorithms_can_be_found_but_not_run(provider_without: Any, provider: Any) -> None:
    from qgis.core import QgsProcessingContext, QgsProcessingException, QgsProcessingFeedback

    context, feedback = QgsProcessingContext(), QgsProcessingFeedback()
    algorithm = provider_without("cv2").algorithm("coregister").create()
    able, why = algorithm.canExecute()
    assert (able, why[: len(COMPLAINT)]) == (False, COMPLAINT)
    assert algorithm.checkParameterValues({}, context) == (False, why)
    with pytest.raises(QgsProcessingException, match="opencv-python-headless"):
        algorithm.run({}, context, feedback, catchExceptions=False)
    assert algorithm.shortHelpString() == why
    whole = provider.algorithm("coregister")
    assert algorithm.displayName() == whole.displayName()
    assert (algorithm.group(), algorithm.groupId()) == (whole.group(), whole.groupId())


def test_a_broken_package_is_told_too(
    provider_without: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from groundtie_qgis import provider

    def broken() -> Any:
        raise ImportError("libGL.so.1: cannot open shared object file\n(in cv2)")

    monkeypatch.setattr(provider, "all_tools", broken)
    made = provider.GroundTieProvider()
    assert made.warningMessage() == (
        "GroundTie cannot use a Python package: libGL.so.1: cannot open shared object file (in cv2)"
    )
    made.refreshAlgorithms()
    assert made.algorithm("warp")


@pytest.mark.parametrize(
    ("debian", "command"),
    [
        (True, "sudo apt install python3-opencv python3-rasterio"),
        (False, "python3 -m pip install --user opencv-python-headless rasterio"),
    ],
)
def test_the_install_command_fits_the_machine(
    plugin: Any, monkeypatch: pytest.MonkeyPatch, debian: bool, command: str
) -> None:
    from groundtie_qgis.dependencies import install_command

    monkeypatch.setattr(Path, "exists", lambda path: debian)
    assert install_command(["opencv-python-headless", "rasterio"]) == command


def test_qgis_process_tells_it_in_one_line(qgis_process: Any, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(HIDE)
    called = qgis_process(
        "run", "groundtie:warp", "--", "INPUT=a.tif", "OUTPUT=b.tif", PYTHONPATH=str(tmp_path)
    )
    assert called.returncode == 1
    assert COMPLAINT in called.stderr
    assert "Traceback" not in called.stderr
    listed = qgis_process("list", PYTHONPATH=str(tmp_path))
    assert "groundtie:coregister" in listed.stdout
