"""The dock's verdict: a coloured heading and the tool's statements."""

from __future__ import annotations

import html
from typing import Any

from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtWidgets import QLabel

from .start_files import file_name
from .translation import tr
from .wording import in_words

_GREEN, _RED = "#1a7f37", "#b3261e"
# Largest number of result lines shown; the report has the others.
_MOST_LINES = 6


class VerdictLabel(QLabel):
    """States whether two layers were registered, with the result or the reason."""

    def __init__(self) -> None:
        super().__init__()
        self.setWordWrap(True)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)

    def state(self, good: bool, text: str, layers: tuple[Any, ...]) -> None:
        """Show a verdict, in which the files of `layers` have the layers' names."""
        heading = tr("✔ Accepted") if good else tr("✘ Not registered")
        for layer in layers:
            text = text.replace(file_name(layer), layer.name())
        lines = html.escape(in_words(text, None)).split("\n")
        self.setText(
            f'<p style="color: {_GREEN if good else _RED}"><b>{heading}</b></p>'
            f"<p>{'<br>'.join(lines)}</p>"
        )


def first_lines(lines: tuple[str, ...]) -> str:
    """Return the first lines of a tool's result."""
    return "\n".join(lines[:_MOST_LINES])
