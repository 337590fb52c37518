"""For tests of commands in processes of their own: surroundings, and what a terminal shows."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
from collections.abc import Sequence
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


def interrupted(command: Sequence[str], end: str, number: signal.Signals) -> tuple[int, str, str]:
    """Send a command a signal once its terminal shows `end`.

    Returns its exit code, its standard output, and the line that the terminal shows then.
    """
    primary, secondary = pty.openpty()
    process = subprocess.Popen(
        command, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=secondary, text=True
    )
    os.close(secondary)
    read_until(primary, end)
    process.send_signal(number)
    rest = read_until(primary, "\n")
    os.close(primary)
    out, _ = process.communicate(timeout=60)
    return process.returncode, out, rest
