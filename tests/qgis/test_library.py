"""Which library the plugin uses, and what surrounds its calls of rasterio."""

from __future__ import annotations

import os
import threading
import warnings
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

PROJ = {"PROJ_LIB": "/elsewhere", "PROJ_DATA": "/elsewhere", "GDAL_DATA": "/elsewhere"}


@pytest.mark.parametrize(
    ("installed", "expected"),
    [
        (None, "groundtie_qgis.groundtie"),
        ("{own}", "groundtie"),
        ("0.0.1", "groundtie_qgis.groundtie"),
    ],
)
def test_an_installed_library_of_the_same_version_wins(
    plugin: Any, monkeypatch: pytest.MonkeyPatch, installed: str | None, expected: str
) -> None:
    from groundtie_qgis import library

    def version(name: str) -> str:
        if installed is None:
            raise metadata.PackageNotFoundError(name)
        return installed.format(own=library.plugin_metadata()["version"])

    monkeypatch.setattr(metadata, "version", version)
    assert library.library_name() == expected


def test_what_is_installed_but_cannot_be_found_does_not_win(
    plugin: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from groundtie_qgis import library

    def find_spec(name: str) -> object:
        return object() if name == library.BUNDLED else None

    monkeypatch.setattr(metadata, "version", lambda name: library.plugin_metadata()["version"])
    monkeypatch.setattr(library.importlib.util, "find_spec", find_spec)
    assert library.library_name() == library.BUNDLED


def test_warnings_meant_for_developers_stay_out_of_the_log(plugin: Any) -> None:
    from groundtie_qgis import library, tool_loading

    with warnings.catch_warnings(record=True) as caught:
        warnings.resetwarnings()
        tool_loading.all_tools()
        for module in (f"{library.library_name()}.rasters.grid", "groundtie_qgis.adapter"):
            warnings.warn_explicit("old", DeprecationWarning, "file.py", 1, module=module)
    assert len(caught) == 1


def test_a_source_tree_has_the_library_elsewhere(
    plugin: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from groundtie_qgis import library

    monkeypatch.setattr(library, "BUNDLED", "groundtie_qgis.no_such_copy")
    assert library.library_name() == "groundtie"


def test_without_its_metadata_the_plugin_has_none(
    plugin: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from groundtie_qgis import library

    assert library.plugin_metadata()["name"] == "GroundTie"
    monkeypatch.setattr(library, "FOLDER", tmp_path)
    assert library.plugin_metadata() == {}


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in PROJ.items():
        monkeypatch.setenv(name, value)


def rasterio_in(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have rasterio found in `folder`."""
    from groundtie_qgis import dependencies

    finder = SimpleNamespace(
        find_spec=lambda name: SimpleNamespace(origin=str(folder / "rasterio" / "__init__.py"))
    )
    monkeypatch.setattr(dependencies, "importlib", SimpleNamespace(util=finder))


def seen_inside() -> dict[str, str]:
    from groundtie_qgis.dependencies import rasterio_env

    with rasterio_env():
        return {name: os.environ[name] for name in PROJ if name in os.environ}


def test_a_wheel_does_not_see_the_data_of_qgis(
    plugin: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elsewhere: None
) -> None:
    (tmp_path / "rasterio" / "proj_data").mkdir(parents=True)
    rasterio_in(tmp_path, monkeypatch)
    assert seen_inside() == {}
    assert {name: os.environ[name] for name in PROJ} == PROJ


def test_the_variables_are_back_after_an_error(
    plugin: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elsewhere: None
) -> None:
    from groundtie_qgis.dependencies import rasterio_env

    (tmp_path / "rasterio" / "proj_data").mkdir(parents=True)
    rasterio_in(tmp_path, monkeypatch)
    with pytest.raises(ZeroDivisionError), rasterio_env():
        raise ZeroDivisionError
    assert {name: os.environ[name] for name in PROJ} == PROJ


def test_a_systems_rasterio_shares_the_data_of_qgis(
    plugin: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elsewhere: None
) -> None:
    rasterio_in(tmp_path, monkeypatch)
    assert seen_inside() == PROJ


def test_two_tools_at_once_leave_the_variables_as_they_were(
    plugin: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elsewhere: None
) -> None:
    from groundtie_qgis.dependencies import rasterio_env

    (tmp_path / "rasterio" / "proj_data").mkdir(parents=True)
    rasterio_in(tmp_path, monkeypatch)
    inside, leave = threading.Event(), threading.Event()
    seen: list[dict[str, str]] = []

    def first() -> None:
        with rasterio_env():
            inside.set()
            leave.wait(10)

    one = threading.Thread(target=first)
    two = threading.Thread(target=lambda: seen.append(seen_inside()))
    one.start()
    assert inside.wait(10)
    two.start()
    leave.set()
    one.join()
    two.join()
    assert seen == [{}]
    assert {name: os.environ[name] for name in PROJ} == PROJ
