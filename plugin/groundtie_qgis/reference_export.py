"""Writes references that are not files, such as web maps or the current map, to a file."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

from qgis.core import (
    QgsCoordinateTransform,
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsProject,
    QgsRasterLayer,
)
from qgis.PyQt.QtCore import QSize, Qt
from qgis.PyQt.QtGui import QColor, QImage

from .dependencies import rasterio_env
from .run import new_file
from .start_files import opened
from .styling import origin
from .translation import mark

MAP = mark("The map as it is drawn")
# Largest side of the drawn image; it is coarser than the input if that is larger.
_MOST_PX = 8192
# Margin around the input, as a share of its longer side, that allows for its misregistration.
_MARGIN = 0.1


def with_files(reference: Any, input: Any, canvas: Any) -> tuple[Any, dict[str, Any]]:
    """Return the reference as a layer that is a file, and the algorithm's values for both.

    Parameters
    ----------
    reference
        A raster layer; None: the map as it is drawn, without the input and layers of the same
        origin.
    input
        The raster layer to be registered.
    canvas
        The map.
    """
    if reference is None:
        # A raster would be registered to itself if the map showed it, or a relative of it.
        layers = [layer for layer in canvas.layers() if origin(layer) != origin(input)]
        reference = drawn(layers, input, "map")
    elif reference.providerType() != "gdal":
        reference = drawn([reference], input, reference.name())
    return reference, {"REFERENCE": named(reference), "INPUT": named(input)}


def named(layer: Any) -> str:
    """Return a layer's identifier for an algorithm: its id in the project, else its source."""
    known = QgsProject.instance().mapLayer(layer.id()) is not None
    return str(layer.id() if known else layer.source())


def drawn(layers: list[Any], input: Any, name: str) -> QgsRasterLayer:
    """Draw layers over the extent of a raster, at its pixel size, into a file; return its layer."""
    path = new_file(f"{name}.tif")
    extent = input.extent()
    extent.grow(_MARGIN * max(extent.width(), extent.height()))
    pixel = input.rasterUnitsPerPixelX()
    pixel *= max(1.0, max(extent.width(), extent.height()) / pixel / _MOST_PX)
    size = QSize(math.ceil(extent.width() / pixel), math.ceil(extent.height() / pixel))
    settings = QgsMapSettings()
    shown = [_without_corners(layer) for layer in layers]  # kept until they are drawn
    settings.setLayers(shown)
    settings.setDestinationCrs(input.crs())
    settings.setTransformContext(QgsProject.instance().transformContext())
    settings.setBackgroundColor(QColor(Qt.GlobalColor.transparent))
    settings.setOutputDpi(96)
    settings.setOutputSize(size)
    settings.setExtent(extent)
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    _write(path, job.renderedImage(), settings.visibleExtent(), input.crs())
    return QgsRasterLayer(str(path), name)


def _without_corners(layer: Any) -> Any:
    """Return a layer like this one that is transparent beside a raster that QGIS turns.

    QGIS draws rotated rasters, and those located by RPCs or GCPs, north up and black beside them.
    """
    is_file = isinstance(layer, QgsRasterLayer) and layer.providerType() == "gdal"
    dataset = opened(layer) if is_file else None
    if dataset is None or not _is_turned(dataset):
        return layer
    from osgeo import gdal

    path = str(new_file("turned.vrt"))
    # QGIS turns with this error of the transform, in pixels, too.
    with suppress(RuntimeError):  # another plugin may have enabled GDAL exceptions
        gdal.Warp(path, dataset, format="VRT", dstAlpha=True, errorThreshold=0.2)
    turned = layer.clone()
    turned.setDataSource(path, layer.name(), "gdal")
    if not turned.isValid():
        return layer  # too few GCPs, by which QGIS cannot turn it either
    turned.setCrs(layer.crs())
    for band in range(1, layer.bandCount() + 1):
        hidden = layer.dataProvider().userNoDataValues(band)
        turned.dataProvider().setUserNoDataValue(band, hidden)
    turned.renderer().setAlphaBand(turned.bandCount())
    return turned


def _is_turned(dataset: Any) -> bool:
    grid = dataset.GetGeoTransform(can_return_null=True)
    if grid is None:
        return bool(dataset.GetGCPCount() or dataset.GetMetadata("RPC"))
    return bool(grid[2] or grid[4])


def _write(path: Any, image: QImage, extent: Any, crs: Any) -> None:
    import numpy as np
    import rasterio
    from rasterio.transform import from_bounds

    image = image.convertToFormat(QImage.Format.Format_RGBA8888)
    width, height = image.width(), image.height()
    bits = image.constBits()
    bits.setsize(image.bytesPerLine() * height)
    pixels = np.frombuffer(bits, np.uint8).reshape(height, -1)[:, : 4 * width]
    *bands, opacity = pixels.reshape(height, width, 4).transpose(2, 0, 1)
    edges = extent.xMinimum(), extent.yMinimum(), extent.xMaximum(), extent.yMaximum()
    profile = {
        "driver": "GTiff",
        "dtype": "uint8",
        "count": 3,
        "width": width,
        "height": height,
        "crs": crs.toWkt(),
        "transform": from_bounds(*edges, width, height),
    }
    with rasterio_env(), rasterio.open(path, "w", **profile) as raster:
        raster.write(np.stack(bands))
        raster.write_mask(opacity > 0)  # Pixels that no layer covers are nodata.


def between(source: Any, target: Any) -> QgsCoordinateTransform:
    """Return the transform between two CRSs."""
    return QgsCoordinateTransform(source, target, QgsProject.instance())


def layer_of(path: Any) -> Any:
    """Return the project's layer of a file; None if there is none."""
    found = [
        layer
        for layer in QgsProject.instance().mapLayers().values()
        if isinstance(layer, QgsRasterLayer) and path is not None and layer.source() == str(path)
    ]
    return found[0] if found else None


def any_of(ids: list[str], *layers: Any) -> bool:
    """Return whether one of the layers, some of which may be None, has one of the ids."""
    return any(layer is not None and layer.id() in ids for layer in layers)
