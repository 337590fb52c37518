"""For tests of commands in processes of their own: surroundings, and what a terminal shows."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": os.pathsep.join([str(ROOT / "algorithms"), str(ROOT / "tests")]),
}


def read_until(terminal: int, end: str) -> str:
    """Read what a terminal shows up to and with `end`."""
    shown = ""
    while not shown.endswith(end):
        shown += os.read(terminal, 1).decode()
    return shown
