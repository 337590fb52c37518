"""Vertical datums: which one a terrain model declares, and where PROJ's grids of the geoids lie."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import rasterio

from ..errors import GeoreferencingError

if TYPE_CHECKING:
    # The tool doctor looks for geoids where OpenCV, which reading needs, is missing.
    from ..rasters.reading import RasterSource

ELLIPSOIDAL = "ellipsoidal"

# PROJ's grids of the geoids' heights above the ellipsoid, by the names that it had and has.
_GRIDS = {
    "EGM96": ("us_nga_egm96_15.tif", "egm96_15.gtx"),
    "EGM2008": ("us_nga_egm08_25.tif", "egm08_25.gtx"),
}
DATUMS = (ELLIPSOIDAL, *_GRIDS)


def declared_datum(dem: RasterSource) -> str | None:
    """Return the vertical datum that a terrain model's compound CRS names, if it is a known one."""
    crs = dem.grid.crs
    text = "" if crs is None else str(crs.to_wkt()).upper().replace(" ", "")
    if "VERT_CS" not in text and "VERTCRS" not in text:
        return None
    return next((name for name in _GRIDS if name in text), None)


def find_geoid(datum: str) -> Path | None:
    """Return the grid of the geoid of a vertical datum; None for the ellipsoid.

    Raises
    ------
    GeoreferencingError
        PROJ's grid is not installed.
    """
    if datum == ELLIPSOIDAL:
        return None
    names = _GRIDS[datum]
    for folder in _proj_folders():
        for name in names:
            if (folder / name).is_file():
                return folder / name
    raise GeoreferencingError(
        f"heights above {datum} need PROJ's grid {names[0]}, which is not installed: get it with "
        f"projsync --file {names[0]}, or give such a grid as geoid (--geoid)"
    )


def _proj_folders() -> list[Path]:
    """Return where PROJ looks for grids."""
    named = [os.environ.get(key, "") for key in ("PROJ_DATA", "PROJ_LIB")]
    own = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "proj"
    folders = [Path(part) for text in named for part in text.split(os.pathsep) if part]
    shared = [Path(sys.prefix) / "share" / "proj", Path("/usr/local/share/proj")]
    bundled = Path(rasterio.__file__).parent / "proj_data"
    return [*folders, own, bundled, *shared, Path("/usr/share/proj")]
