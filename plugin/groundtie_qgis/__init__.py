"""The QGIS plugin: GroundTie's tools in the Processing toolbox and the model designer."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

OLDEST_PYTHON = (3, 10)


def classFactory(iface: Any) -> Any:
    """Return the plugin (called by QGIS; `iface` is None without a desktop)."""
    if sys.version_info < OLDEST_PYTHON:
        # An older Python cannot import the other modules.
        from .old_python import OldPython

        return OldPython(iface, OLDEST_PYTHON)
    from qgis.core import QgsApplication

    from .installing import packages_folder, use_packages

    packages = packages_folder(Path(QgsApplication.qgisSettingsDirPath()))
    use_packages(packages)
    from .plugin import GroundTiePlugin

    return GroundTiePlugin(iface, packages)
