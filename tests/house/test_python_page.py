"""The examples of docs/python.md run, from the first to the last, in one folder."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs/python.md"
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)


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
