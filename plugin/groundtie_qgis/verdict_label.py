"""The dock's verdict: a coloured heading, and what the tool stated."""

from __future__ import annotations

import html
from typing import Any

from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtWidgets import QLabel

from .start_files import file_name
from .translation import tr
from .wording import in_words

_GREEN, _RED = "#1a7f37", "#b3261e"
# What the lines that come after a tool's steps begin with.
_RESULTS = ("the input", "correction", "accepted")


class VerdictLabel(QLabel):
    """States whether two layers were registered, and what came of it or why not."""

    def __init__(self) -> None:
        super().__init__()
        self.setWordWrap(True)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)

    def state(self, good: bool, text: str, layers: tuple[Any, ...]) -> None:
        """Show a verdict; files of `layers` are named as these are."""
        heading = tr("✔ Accepted") if good else tr("✘ Not registered")
        for layer in layers:
            text = text.replace(file_name(layer), layer.name())
        lines = html.escape(in_words(text, None)).split("\n")
        self.setText(
            f'<p style="color: {_GREEN if good else _RED}"><b>{heading}</b></p>'
            f"<p>{'<br>'.join(lines)}</p>"
        )


def first_lines(lines: tuple[str, ...], most: int = 6) -> list[str]:
    """Return what a tool stated of its result: what comes after its steps."""
    starts = [i for i, line in enumerate(lines) if line.startswith(_RESULTS)]
    return list(lines[starts[0] if starts else -most :][:most])
