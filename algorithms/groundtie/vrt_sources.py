"""The sources of GDAL's virtual rasters, read from the files without GDAL."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from .raster_names import SEARCHED_BYTES, is_gdal_name, local_files

# Beginning of a virtual raster, whatever its file is called.
_START = b"<VRTDataset"

# Elements that name a source, in any case: of mosaics, bands, overviews and warped rasters.
_SOURCES = ("sourcefilename", "sourcedataset")


def sources_of(path: Path) -> list[Path]:
    """Return the sources of a virtual raster, and the sources of these.

    GDAL, which is not asked, would name only the direct sources. Other rasters have none. Links are
    followed, as GDAL does before it resolves a name relative to the virtual raster.
    """
    try:
        own = path.resolve()
    except (OSError, RuntimeError):  # a loop of links
        return []
    found: dict[Path, None] = {own: None}
    waiting = [own]
    while waiting:
        new = [one for one in _named_in(waiting.pop()) if one not in found]
        found |= dict.fromkeys(new)
        waiting += new
    return list(found)[1:]


def _named_in(path: Path) -> list[Path]:
    try:
        if not _is_virtual(path):
            return []
        root = ElementTree.parse(path).getroot()
        sources = [one for one in root.iter() if one.tag.lower() in _SOURCES and one.text]
        return [place.resolve() for one in sources for place in _places(one, path.parent)]
    except (OSError, RuntimeError, ElementTree.ParseError, ValueError, LookupError):
        return []  # damaged, of an unknown encoding, or a loop of links


def _is_virtual(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _START in file.read(SEARCHED_BYTES)


def _places(source: ElementTree.Element, folder: Path) -> list[Path]:
    """Return the places of a source: its file, or the files that a name of GDAL's refers to."""
    name = str(source.text)
    is_relative = {key.lower(): word for key, word in source.items()}.get("relativetovrt") == "1"
    place = folder / name if is_relative else Path(name)
    if place.exists() or not is_gdal_name(name):
        return [place]
    # A source without a known file keeps its name as a path.
    return local_files(name, folder if is_relative else "") or [place]
