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
# How many lines of a result are shown: its report has the others.
_MOST_LINES = 6


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


def first_lines(lines: tuple[str, ...]) -> str:
    """Return the first of what a tool stated of its result."""
    return "\n".join(lines[:_MOST_LINES])
