"""What GDAL's virtual rasters are made of: read from the files, without GDAL."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

# What a virtual raster begins with, whatever its file is called.
_START = b"<VRTDataset"
_SEARCHED_BYTES = 1024

# What names a source, in any case: of mosaics, bands and overviews, and of what is warped.
_SOURCES = ("sourcefilename", "sourcedataset")


def sources_of(path: Path) -> list[Path]:
    """Return the files that a virtual raster is made of, and those that these are made of.

    GDAL, which is not asked, names the first ones alone; other rasters are made of none. Links are
    followed, as GDAL does before it takes a name relative to the virtual raster.
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
        return [_place(one, path.parent).resolve() for one in sources]
    except (OSError, RuntimeError, ElementTree.ParseError, ValueError, LookupError):
        return []  # damaged, of an encoding that nobody knows, or a loop of links


def _is_virtual(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _START in file.read(_SEARCHED_BYTES)


def _place(source: ElementTree.Element, folder: Path) -> Path:
    name = str(source.text)
    is_relative = {key.lower(): word for key, word in source.items()}.get("relativetovrt") == "1"
    return folder / name if is_relative else Path(name)
