"""The documentation that the plugin carries."""

from __future__ import annotations

from qgis.PyQt.QtCore import QUrl

from .library import FOLDER


def help_url(name: str) -> str:
    """Return the URL of a tool's or another page; empty if the page was not bundled."""
    page = FOLDER / "help" / f"{name.replace('_', '-')}.html"
    return QUrl.fromLocalFile(str(page)).toString() if page.is_file() else ""
