"""The examples of docs/python.md run, in their order; so does that of a tool, for developers."""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from raster_files import write_raster

from groundtie.declaration import tool_of

PAGE = Path(__file__).resolve().parents[2] / "docs/python.md"
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.M | re.S)
BLOCKS = BLOCK.findall(PAGE.read_text(encoding="utf-8"))


@pytest.fixture
def _logging_as_it_was() -> Iterator[None]:
    root, own = logging.getLogger(), logging.getLogger("groundtie")
    handlers, level = list(root.handlers), own.level
    yield
    root.handlers[:] = handlers
    own.setLevel(level)


@pytest.mark.slow
@pytest.mark.usefixtures("_logging_as_it_was")
def test_the_examples_run_in_their_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for number, block in enumerate(BLOCKS, start=1):
        exec(compile(block, f"{PAGE.name}, example {number}", "exec"), names)
    assert names["registration"].verdict.accepted
    assert names["verdict"].accepted
    assert names["errors_px"].mean() < 1
    assert names["image"].values.ndim == 3
    for written in ("registered.tif", "warped.tif", "report.html"):
        assert Path(written).is_file()
    assert "groundtie.progress" in caplog.text


def test_the_example_of_a_new_tool_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = PAGE.with_name("development.md").read_text(encoding="utf-8")
    (example,) = BLOCK.findall(page)
    module = ModuleType("groundtie.tools.raster_size")
    module.__package__ = "groundtie.tools"
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(example, "docs/development.md", "exec"), vars(module))
    image = write_raster(tmp_path / "a.tif", np.ones((3, 5), np.uint8))
    assert tool_of(module.raster_size).name == "raster_size"
    assert module.raster_size(image).summary() == {"width": 5, "height": 3}
