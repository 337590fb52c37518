"""GDAL's virtual rasters: a file's own pixels, in another place."""

from __future__ import annotations

import os
import re
from pathlib import Path
from xml.etree import ElementTree

import rasterio.shutil

from ..errors import ParameterError
from ..runs import RUN_TAG, run_tags
from .atomic import scratch_file, writing
from .grid import Grid
from .reading import RasterSource
from .remote import environment

SUFFIX = ".vrt"

# GDAL's name of what lies in an archive, whose path has no slash at its start.
_IN_ARCHIVE = re.compile(r"(/vsi(?:zip|tar|gzip|7z|rar)/)([^/{].*)")

# What stands between the parts of other names, as NETCDF:"a.nc":band; C:\\… is one.
_PARTS = re.compile(r"[\"{},]|(?<!\b[A-Za-z]):")

# What else would locate the pixels, or is of the file that they are in.
_OWN = ("GCPList", "GeoTransform")
_OWN_DOMAINS = ("RPC", "GEOLOCATION", "DERIVED_SUBDATASETS")


def write_vrt(source: RasterSource, grid: Grid, path: Path) -> None:
    """Write a virtual raster that shows a raster's pixels, masks and overviews on another grid.

    It names the raster's file, relative to itself where both are on one disk: it must stay there.

    Parameters
    ----------
    source
        The raster.
    grid
        Its new grid, of the same size and CRS.
    path
        The `.vrt`; see `atomic.Outputs.stage`.

    Raises
    ------
    ParameterError
        The raster is in memory, or its name means another file in another working folder.
    OutputError
        The file cannot be written.
    """
    if not source.is_file:
        raise ParameterError(f"a {SUFFIX} refers to a file, which {source.path} is not")
    name = _absolute(source.path)
    with writing(path), scratch_file(path) as scratch, environment(source.path):
        rasterio.shutil.copy(name, scratch, driver="VRT")
        root = ElementTree.parse(scratch).getroot()
        for element in root.iter("SourceFilename"):
            if element.text == name and os.path.exists(name):
                element.text = _relative(name, path.parent)
                element.set("relativeToVRT", "0" if os.path.isabs(element.text) else "1")
        for element in list(root):
            if element.tag in _OWN or element.get("domain") in _OWN_DOMAINS:
                root.remove(element)
        place = ElementTree.Element("GeoTransform")
        place.text = ", ".join(repr(number) for number in grid.transform.to_gdal())
        root.insert(0, place)
        for key, value in run_tags(RUN_TAG).items():
            tag = ElementTree.SubElement(ElementTree.SubElement(root, "Metadata"), "MDI", key=key)
            tag.text = value
        ElementTree.ElementTree(root).write(path, encoding="utf-8")


def _absolute(name: str) -> str:
    """Return a raster's name that means the same in any working folder: GDAL makes none so."""
    if os.path.exists(name):
        return os.path.abspath(name)
    archive = _IN_ARCHIVE.fullmatch(name)
    if archive and any(os.path.isfile(path) for path in (archive[2], *Path(archive[2]).parents)):
        return archive[1] + os.path.abspath(archive[2])
    if any(os.path.exists(part) and not os.path.isabs(part) for part in _PARTS.split(name)):
        raise ParameterError(
            f"a {SUFFIX} cannot refer to {name}, which is relative to the working folder: "
            "give the whole path"
        )
    return name


def _relative(name: str, folder: Path) -> str:
    try:
        return os.path.relpath(name, folder)
    except ValueError:  # another disk of Windows
        return name
