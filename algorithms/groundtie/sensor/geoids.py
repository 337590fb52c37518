"""Where PROJ's grids of the geoids lie, by which heights above sea level are used."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import rasterio

from ..errors import GeoreferencingError

ELLIPSOIDAL = "ellipsoidal"

# PROJ's grids of the geoids' heights above the ellipsoid, by the names that it had and has.
GEOID_GRIDS = {
    "EGM96": ("us_nga_egm96_15.tif", "egm96_15.gtx"),
    "EGM2008": ("us_nga_egm08_25.tif", "egm08_25.gtx"),
}
DATUMS = (ELLIPSOIDAL, *GEOID_GRIDS)


def find_geoid(datum: str) -> Path | None:
    """Return the grid of the geoid of a vertical datum; None for the ellipsoid.

    Raises
    ------
    GeoreferencingError
        PROJ's grid is not installed.
    """
    if datum == ELLIPSOIDAL:
        return None
    names = GEOID_GRIDS[datum]
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
