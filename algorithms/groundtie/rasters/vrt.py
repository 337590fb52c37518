"""GDAL's virtual rasters: a file's pixels with another geotransform."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import rasterio
import rasterio.shutil
from rasterio.enums import MaskFlags

from ..errors import ParameterError
from ..raster_names import file_on_the_way_to, in_archive, parts_of
from ..runs import RUN_TAG, run_tags
from .atomic import scratch_file, writing
from .grid import Grid
from .metadata import stated
from .reading import RasterSource
from .remote import environment

SUFFIX = ".vrt"

# Elements and domains that would locate the pixels otherwise, or belong to the source file.
_OWN = ("GCPList", "GeoTransform")
_OWN_DOMAINS = ("RPC", "GEOLOCATION", "DERIVED_SUBDATASETS")

# GDAL's metadata domain with the text of a virtual raster, and the only key in it.
_TEXT = "xml:VRT"

# Elements of a virtual raster, and of a band, that describe pixels; the others produce them.
_STATED = ("SRS", "Metadata", "VRTRasterBand")
_STATED_OF_BAND = (
    "Description",
    "Metadata",
    "UnitType",
    "Offset",
    "Scale",
    "CategoryNames",
    "ColorInterp",
    "ColorTable",
    "GDALRasterAttributeTable",
    "NoDataValue",
    "HideNoDataValue",
)


def write_vrt(source: RasterSource, grid: Grid, path: Path) -> None:
    """Write a virtual raster that shows a raster's pixels, masks and overviews on another grid.

    It refers to the raster's file, which must stay in place, by a relative path if both are on one
    disk.

    Parameters
    ----------
    source
        The raster.
    grid
        The new grid, of the same size and CRS.
    path
        The `.vrt`; see `atomic.Outputs.stage`.

    Raises
    ------
    ParameterError
        The raster is in memory, or its name depends on the working folder.
    OutputError
        The file cannot be written.
    """
    if source.place is None:
        raise ParameterError(f"a {SUFFIX} refers to a file, which {source.path} is not")
    name = _absolute(source.place)
    with writing(path), environment(source.path):
        with rasterio.open(name) as dataset:
            is_virtual = dataset.driver == "VRT"
            root = _showing_virtual(dataset, name) if is_virtual else _showing(dataset, path)
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


def _showing(dataset: Any, path: Path) -> ElementTree.Element:
    """Return a virtual raster of a raster that is not virtual itself; `path` is staged."""
    with scratch_file(path) as scratch:
        rasterio.shutil.copy(dataset, scratch, driver="VRT")
        return ElementTree.parse(scratch).getroot()


def _showing_virtual(dataset: Any, name: str) -> ElementTree.Element:
    """Return a virtual raster of a virtual raster.

    GDAL would copy its sources, and interpret names relative to the original as relative to the
    copy.
    """
    root = ElementTree.fromstring(dataset.tags(ns=_TEXT)[_TEXT])
    size = {key: root.attrib[key] for key in ("rasterXSize", "rasterYSize")}
    made = ElementTree.Element(root.tag, size)
    made.extend(element for element in root if element.tag in _STATED)
    flags = stated(lambda: dataset.mask_flag_enums)
    for number, element in enumerate(made.findall("VRTRasterBand"), start=1):
        kind, described = element.attrib["dataType"], list(element)
        element.clear()
        element.attrib |= {"dataType": kind, "band": str(number)}
        element.extend(part for part in described if part.tag in _STATED_OF_BAND)
        element.append(_pixels(name, str(number)))
        if not flags[number - 1]:
            element.append(_mask(name, number))
    if flags[0] == [MaskFlags.per_dataset]:
        made.append(_mask(name, 1))
    return made


def _pixels(name: str, band: str) -> ElementTree.Element:
    element = ElementTree.Element("SimpleSource")
    ElementTree.SubElement(element, "SourceFilename", relativeToVRT="0").text = name
    ElementTree.SubElement(element, "SourceBand").text = band
    return element


def _mask(name: str, band: int) -> ElementTree.Element:
    element = ElementTree.Element("MaskBand")
    ElementTree.SubElement(element, "VRTRasterBand", dataType="Byte").append(
        _pixels(name, f"mask,{band}")
    )
    return element


def _absolute(name: str) -> str:
    """Return a raster's name that holds in any working folder; GDAL keeps names relative."""
    if os.path.exists(name):
        return os.path.abspath(name)
    archives, path = in_archive(name)
    if archives and not os.path.isabs(path) and file_on_the_way_to(Path(path)):
        return archives + os.path.abspath(path)
    if any(os.path.exists(part) and not os.path.isabs(part) for part in parts_of(name)):
        raise ParameterError(
            f"a {SUFFIX} cannot refer to {name}, which is relative to the working folder: "
            "give the whole path"
        )
    return name


def _relative(name: str, folder: Path) -> str:
    # Systems follow links before they go up to a parent folder. The name of a link to the file is
    # kept: by this name GDAL finds sidecar files.
    place = os.path.join(os.path.realpath(os.path.dirname(name)), os.path.basename(name))
    try:
        return os.path.relpath(place, os.path.realpath(folder))
    except ValueError:  # another disk of Windows
        return name
