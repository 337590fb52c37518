"""The QGIS plugin: GroundTie's tools in the Processing toolbox and the model designer."""

from __future__ import annotations

from typing import Any


def classFactory(iface: Any) -> Any:
    """Return the plugin (called by QGIS; `iface` is None without a desktop)."""
    from .plugin import GroundTiePlugin

    return GroundTiePlugin()
