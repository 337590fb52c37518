"""The documentation that the plugin carries."""

from __future__ import annotations

from qgis.PyQt.QtCore import QUrl

from .library import FOLDER


def help_url(name: str) -> str:
    """Return where the page of a tool, or another one, lies; empty if it was not built in."""
    page = FOLDER / "help" / f"{name.replace('_', '-')}.html"
    return QUrl.fromLocalFile(str(page)).toString() if page.is_file() else ""
