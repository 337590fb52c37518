"""Vertical datums: which one a terrain model declares, and where PROJ's geoid grids lie."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import rasterio
from rasterio.crs import CRS

from ..errors import GeoreferencingError

ELLIPSOIDAL = "ellipsoidal"

# PROJ's grids of geoid heights above the ellipsoid: the file's current and former name.
_GRIDS = {
    "EGM96": ("us_nga_egm96_15.tif", "egm96_15.gtx"),
    "EGM2008": ("us_nga_egm08_25.tif", "egm08_25.gtx"),
}

# The name of the vertical part of a compound CRS, in WKT 1 or 2.
_VERTICAL = re.compile(r'\bVERT(?:_CS|CRS)\["([^"]*)"', re.IGNORECASE)
_NO_DATUM = re.compile(r"^$|unknown|unnamed", re.IGNORECASE)
# The vertical part of a CRS, or the third axis of another one, that counts from the ellipsoid.
_ELLIPSOID = re.compile(r'\b(VERT_CS|VERTCRS|AXIS)\["[^"]*ellipsoid', re.IGNORECASE)
_COMPOUND = re.compile(r'COMPD_CS\["[^"]*",(.*),VERT_CS\[', re.DOTALL)

DATUMS = (ELLIPSOIDAL, *_GRIDS)


def declared_datum(crs: CRS | None) -> str | None:
    """Return the vertical datum of a CRS: a name of `DATUMS`, or the CRS's own name.

    None: the CRS names no datum.
    """
    wkt = "" if crs is None else crs.to_wkt()
    if _ELLIPSOID.search(wkt):
        return ELLIPSOIDAL
    found = _VERTICAL.search(wkt)
    if found is None or _NO_DATUM.search(found[1]):
        return None
    text = found[1].upper().replace(" ", "")
    return next((name for name in _GRIDS if name in text), found[1])


def horizontal(crs: CRS) -> CRS:
    """Return a compound CRS without its vertical part; other CRSs as they are."""
    found = _COMPOUND.match(crs.to_wkt())
    return crs if found is None else CRS.from_wkt(found[1])


def find_geoid(datum: str) -> Path | None:
    """Return the geoid grid of a vertical datum; None for the ellipsoid.

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
    """Return the folders in which PROJ looks for grids."""
    named = [os.environ.get(key, "") for key in ("PROJ_DATA", "PROJ_LIB")]
    own = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "proj"
    folders = [Path(part) for text in named for part in text.split(os.pathsep) if part]
    shared = [Path(sys.prefix) / "share" / "proj", Path("/usr/local/share/proj")]
    bundled = Path(rasterio.__file__).parent / "proj_data"
    return [*folders, own, bundled, *shared, Path("/usr/share/proj")]
