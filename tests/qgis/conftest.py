"""A real QGIS with the built plugin, in this process and as `qgis_process`."""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import pytest
from desktops import Desktop
from noise_pairs import write_pair

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

ROOT = Path(__file__).resolve().parents[2]
# Debian's qgis_process is a broken wrapper of this one (QGIS issue 57683)
QGIS_PROCESS = shutil.which("qgis_process.bin", path="/usr/bin") or shutil.which("qgis_process")
QgisProcess = Callable[..., "subprocess.CompletedProcess[str]"]


def unpack_plugin(folder: Path) -> Path:
    """Build the plugin as for users, unzip it into `folder` and return that."""
    archive = folder / "groundtie_qgis.zip"
    command = [sys.executable, str(ROOT / "scripts" / "build_plugin.py"), str(archive)]
    subprocess.run(command, check=True, capture_output=True)
    with zipfile.ZipFile(archive) as plugin:
        plugin.extractall(folder)
    return folder


@pytest.fixture(scope="session")
def plugin_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the built plugin lies."""
    return unpack_plugin(tmp_path_factory.mktemp("plugins"))


_ONE_MORE = """
from ..toys import TOY

_load_shipped = load_tools


def load_tools():
    return (*_load_shipped(), TOY)
"""


@pytest.fixture(scope="session")
def toy_plugin_folder(plugin_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a built plugin whose library has one tool more: that of tests/toys.py."""
    folder = tmp_path_factory.mktemp("toy_plugins")
    shutil.copytree(plugin_folder / "groundtie_qgis", folder / "groundtie_qgis")
    library = folder / "groundtie_qgis" / "groundtie"
    toys = (ROOT / "tests" / "toys.py").read_text(encoding="utf-8")
    (library / "toys.py").write_text(toys.replace("from groundtie.", "from ."), encoding="utf-8")
    with (library / "tools" / "__init__.py").open("a", encoding="utf-8") as tools:
        tools.write(_ONE_MORE)
    return folder


@pytest.fixture(scope="session")
def qgis_app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A running QGIS application with Processing."""
    os.environ["QGIS_CUSTOM_CONFIG_PATH"] = str(tmp_path_factory.mktemp("profile"))
    sys.path.append("/usr/share/qgis/python/plugins")
    from qgis.core import QgsApplication, QgsProject

    app = QgsApplication([], True)
    QgsApplication.initQgis()
    from processing.core.Processing import Processing

    Processing.initialize()
    yield app
    from qgis.PyQt.QtCore import QCoreApplication, QEvent, QThreadPool

    # a layer, a thread or a widget that outlives QGIS crashes it
    QgsProject.instance().clear()
    gc.collect()
    QgsApplication.taskManager().cancelAll()
    QThreadPool.globalInstance().waitForDone()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    Processing.deinitialize()
    QgsApplication.exitQgis()


@pytest.fixture(scope="session")
def plugin(qgis_app: Any, toy_plugin_folder: Path) -> Iterator[Any]:
    """The plugin, started as qgis_process starts it, with the toy tool.

    Nothing of the package is installed, so that the plugin takes its own copy, which has the toy.
    """
    sys.path.insert(0, str(toy_plugin_folder))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(metadata, "version", _nothing_installed)
        import groundtie_qgis

        plugin = groundtie_qgis.classFactory(None)
        plugin.initProcessing()
        yield plugin
        plugin.unload()


def _nothing_installed(name: str) -> str:
    raise metadata.PackageNotFoundError(name)


@pytest.fixture
def provider(plugin: Any) -> Any:
    """The plugin's registered provider."""
    return plugin.provider


def qgis_environment(folder: Path, plugins: Path) -> dict[str, str]:
    """Return the environment of a `qgis_process` with a profile of its own."""
    for name in ("profile", "runtime"):
        (folder / name).mkdir(mode=0o700)
    return {
        # a virtual environment on PATH would crash it
        "PATH": "/usr/bin:/bin",
        "HOME": str(folder / "profile"),
        "LC_ALL": "C.UTF-8",
        "PYTHONWARNINGS": "ignore::DeprecationWarning",
        "QGIS_CUSTOM_CONFIG_PATH": str(folder / "profile"),
        "QGIS_PLUGINPATH": str(plugins),
        "QT_QPA_PLATFORM": "offscreen",
        "XDG_RUNTIME_DIR": str(folder / "runtime"),
    }


# QGIS 3.40 writes it now and then, whatever it is called for.
OWN_LINE_OF_QGIS = "QFile::remove: Empty or null file name\n"


def qgis_process_in(folder: Path, plugins: Path) -> QgisProcess:
    """Return a function that calls `qgis_process` with the plugin in `plugins` enabled."""
    assert QGIS_PROCESS, "qgis_process is not installed: see scripts/system_packages.sh"
    environment = qgis_environment(folder, plugins)

    def call(*words: object, **more: str) -> subprocess.CompletedProcess[str]:
        command = [QGIS_PROCESS, *map(str, words)]
        called = subprocess.run(
            command,
            env={**environment, **more},
            text=True,
            capture_output=True,
            timeout=300,
            check=False,
        )
        called.stderr = called.stderr.replace(OWN_LINE_OF_QGIS, "")
        return called

    assert call("plugins", "enable", "groundtie_qgis").returncode == 0
    return call


@pytest.fixture(scope="session")
def qgis_process(tmp_path_factory: pytest.TempPathFactory, plugin_folder: Path) -> QgisProcess:
    """Call `qgis_process` with the built plugin; keywords are environment variables."""
    return qgis_process_in(tmp_path_factory.mktemp("qgis_process"), plugin_folder)


@pytest.fixture
def iface(provider: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """What dialogs and dock need of a desktop."""
    import qgis.utils
    from qgis.core import QgsProject
    from qgis.gui import QgsMapCanvas
    from qgis.PyQt import sip
    from qgis.PyQt.QtWidgets import QMainWindow

    window, iface = QMainWindow(), MagicMock()
    iface.mainWindow.return_value = window
    iface.mapCanvas.return_value = QgsMapCanvas(window)
    iface.activeLayer.return_value = None
    monkeypatch.setattr(qgis.utils, "iface", iface)
    yield iface
    iface.mapCanvas().setLayers([])
    QgsProject.instance().clear()
    sip.delete(window)


@pytest.fixture
def desktop(provider: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desktop]:
    import qgis.utils
    from qgis.core import QgsProject
    from qgis.PyQt import sip

    made = Desktop(Path(os.environ.get("GROUNDTIE_PICTURES") or tmp_path / "pictures"))
    monkeypatch.setattr(qgis.utils, "iface", made.iface)
    yield made
    if made.dock is not None:
        made.dock.take_away()
    made.canvas.setLayers([])
    QgsProject.instance().clear()
    # What outlives QGIS crashes it.
    sip.delete(made.window)
    vars(made).clear()
    gc.collect()


@pytest.fixture(scope="session")
def registered_files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What a registration of the pair leaves, made once."""
    import groundtie

    folder = tmp_path_factory.mktemp("registered")
    write_pair(folder, 0)
    files = {"OUTPUT": folder / "registered.tif", "TIE_POINTS": folder / "tie_points.gpkg"}
    groundtie.coregister(
        folder / "reference.tif",
        folder / "input.tif",
        files["OUTPUT"],
        search_radius=12.0,
        model="affine",
        tie_points=files["TIE_POINTS"],
    )
    return files


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, dict[str, Any]]]:
    """Tool and values of every run, each of which is refused with a report."""
    from groundtie_qgis import start_page
    from groundtie_qgis.run import Outcome

    runs: list[tuple[str, dict[str, Any]]] = []

    class Refused:
        def __init__(self, *parts: Any) -> None:
            tool, values, files, _, self._done, _ = parts
            runs.append((tool, values))
            self._files = {"REPORT": files["REPORT"]}

        def start(self) -> None:
            self._files["REPORT"].write_text("refused", encoding="utf-8")
            self._done(Outcome(False, "nothing in common was found", files=self._files))

    monkeypatch.setattr(start_page, "Run", Refused)
    return runs
