"""What all tests share: the folder of real image pairs, and where QGIS is missing."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest
from hypothesis import settings

from groundtie.packages import use_one_thread

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("GROUNDTIE_DATA") or ROOT.parent / "shared" / "data").resolve()

# Before numpy and OpenCV are there: the suites run side by side, on all processors.
use_one_thread()

# How long an example takes says nothing where other work runs beside it.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


def _has_qgis() -> bool:
    # Not "qgis": pytest has tests/ on the path, where tests/qgis would pass for a package.
    try:
        return importlib.util.find_spec("qgis.core") is not None
    except ModuleNotFoundError:
        return False


HAS_QGIS = _has_qgis()
collect_ignore = [] if HAS_QGIS else ["qgis"]


def pytest_configure() -> None:
    if not HAS_QGIS and os.environ.get("GROUNDTIE_REQUIRE_QGIS") == "1":
        raise pytest.UsageError("GROUNDTIE_REQUIRE_QGIS=1, but this Python has no qgis.core")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    # Files with slow tests first: what two workers do last should be short.
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
    for item in items:
        if "real_data" in getattr(item, "fixturenames", ()):
            item.add_marker("real_data")


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("real_data") is None or DATA.is_dir():
        return
    if os.environ.get("CI") == "true":
        pytest.fail(f"CI=true needs the real image pairs: no folder {DATA}", pytrace=False)
    pytest.skip(f"no folder of real image pairs: {DATA}")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    # A module that is skipped as a whole leaves a report without keywords.
    reports = terminalreporter.stats.get("skipped", ())
    skipped = [report for report in reports if "real_data" in getattr(report, "keywords", ())]
    if skipped:
        terminalreporter.section("NOT TESTED: real image pairs", yellow=True)
        terminalreporter.line(f"{len(skipped)} tests skipped: no folder {DATA}; set GROUNDTIE_DATA")
    if not HAS_QGIS:
        terminalreporter.section("NOT TESTED: QGIS", yellow=True)
        terminalreporter.line("tests/qgis left out: this Python has no QGIS")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Return the folder of real image pairs; tests that take it are marked `real_data`."""
    return DATA
