"""Converts the values of Processing parameters into the tools' values."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from qgis.core import (
    NULL,
    QgsCoordinateReferenceSystem,
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingUtils,
    QgsRasterLayer,
    QgsVectorFileWriter,
    QgsVectorLayer,
)

from .definitions import qgis_name, takes_layers
from .library import errors, kinds
from .start_files import crs_of_file, file_name, without_options
from .translation import tr


class Reader:
    """Reads the values of one call of an algorithm.

    Parameters
    ----------
    algorithm, parameters, context
        As passed by Processing; the context loads outputs that are layers.
    feedback
        Receives messages about layers that must be written to a file first.
    """

    def __init__(
        self,
        algorithm: QgsProcessingAlgorithm,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> None:
        self._algorithm = algorithm
        self._parameters = parameters
        self._context = context
        self._feedback = feedback

    def read(self, parameter: Any) -> Any:
        """Return the value of a declared parameter; None if it was not given.

        Raises
        ------
        ParameterError
            A layer is not based on a file, or has another CRS than its file.
        """
        name, kind = qgis_name(parameter.name), parameter.kind
        given = self._parameters.get(name)
        if given is None or given == NULL or given == "":
            return None
        if isinstance(kind, kinds.RasterIn):
            return self._raster(kind, name, given)
        if isinstance(kind, kinds.RastersIn):
            return self._rasters(kind, given)
        if isinstance(kind, kinds.VectorIn):
            return self._vector(kind, name, given)
        if isinstance(kind, kinds.MaskIn):
            return self._mask(kind, name, given)
        if isinstance(kind, kinds.Choice):
            return self._word(name)
        if isinstance(kind, kinds.Crs):
            return self._crs(name)
        return self._method(kind)(self._parameters, name, self._context)

    def _method(self, kind: Any) -> Any:
        """Return the algorithm's method that reads values of this kind."""
        algorithm = self._algorithm
        if isinstance(kind, (kinds.RasterOut, kinds.VectorOut)):
            return algorithm.parameterAsOutputLayer
        if isinstance(kind, kinds.FileOut):
            return algorithm.parameterAsFileOutput
        if isinstance(kind, kinds.Flag):
            return algorithm.parameterAsBool
        if isinstance(kind, kinds.Band) or (isinstance(kind, kinds.Number) and kind.integer):
            return algorithm.parameterAsInt
        if isinstance(kind, kinds.Number):
            return algorithm.parameterAsDouble
        return algorithm.parameterAsString

    def _word(self, name: str) -> str:
        given = self._algorithm.parameterAsString(self._parameters, name, self._context)
        return self._algorithm.parameterDefinition(name).word(given) or given

    def _crs(self, name: str) -> str | None:
        crs = self._algorithm.parameterAsCrs(self._parameters, name, self._context)
        return (crs.authid() or crs.toWkt()) if crs.isValid() else None

    def _raster(self, kind: Any, name: str, given: Any) -> Any:
        layer = self._algorithm.parameterAsRasterLayer(self._parameters, name, self._context)
        if layer is None:
            return given  # the library's error message is better than QGIS's
        return _file_of(layer, kind)

    def _rasters(self, kind: Any, given: Any) -> list[str]:
        several = given if isinstance(given, (list, tuple)) else [given]
        return [self._raster_or_name(kind, one) for one in several]

    def _raster_or_name(self, kind: Any, given: Any) -> str:
        """Return the file of a raster layer; folders, patterns and tables are not layers."""
        layer = given
        if isinstance(given, str):
            layer = QgsProcessingUtils.mapLayerFromString(given, self._context, False)
            if not isinstance(layer, QgsRasterLayer):
                return without_options(given)
        return _file_of(layer, kind)

    def _mask(self, kind: Any, name: str, given: Any) -> Any:
        if isinstance(given, str) and Path(given).is_file():
            return given  # a classifier is not a layer, but GDAL may take it for one
        layer = self._algorithm.parameterAsLayer(self._parameters, name, self._context)
        if isinstance(layer, QgsVectorLayer):
            return self._vector(kind, name, given)
        return self._raster(kind, name, given)

    def _vector(self, kind: Any, name: str, given: Any) -> Any:
        layer = self._algorithm.parameterAsVectorLayer(self._parameters, name, self._context)
        if layer is not None and layer.isModified():  # its file lacks what is not saved yet
            return _snapshot(layer, tr(kind.label), self._context)
        path = self._algorithm.parameterAsCompatibleSourceLayerPath(
            self._parameters, name, self._context, ["gpkg", "geojson"], "gpkg", self._feedback
        )
        return path or given


def with_layers_as_files(
    algorithm: QgsProcessingAlgorithm,
    tool: Any,
    parameters: dict[str, Any],
    context: QgsProcessingContext,
) -> dict[str, Any]:
    """Return the parameters of a call, with layers of points written to files as they are now.

    The files include unsaved edits and respect the layer's filter. Call this in the main thread,
    to which the layers belong.

    Raises
    ------
    ParameterError
        A layer cannot be written.
    """
    written = dict(parameters)
    for parameter in tool.parameters:
        name = qgis_name(parameter.name)
        given = parameters.get(name)
        if not takes_layers(parameter.kind) or (isinstance(given, str) and Path(given).is_file()):
            continue
        layer = algorithm.parameterAsLayer(parameters, name, context)
        if isinstance(layer, QgsVectorLayer):
            written[name] = _snapshot(layer, tr(parameter.kind.label), context)
    return written


def _snapshot(layer: QgsVectorLayer, label: str, context: QgsProcessingContext) -> str:
    options = QgsVectorFileWriter.SaveVectorOptions()
    options.driverName = "GPKG"
    # The fids of new features are not numbers yet.
    options.attributes = [
        index for index, field in enumerate(layer.fields()) if field.name().lower() != "fid"
    ]
    options.skipAttributeCreation = not options.attributes
    name = re.sub(r"[^\w-]+", "_", layer.name()) or "layer"
    path = QgsProcessingUtils.generateTempFilename(f"{name}.gpkg")
    transforms = context.transformContext()
    failed, message, *_ = QgsVectorFileWriter.writeAsVectorFormatV3(
        layer, path, transforms, options
    )
    if failed:
        raise errors.ParameterError(f"{label}: the layer {layer.name()} cannot be read: {message}")
    return str(path)


def _file_of(layer: Any, kind: Any) -> str:
    """Return the file of a raster layer; `ParameterError` if it has none, or another CRS."""
    provider = layer.providerType()
    if provider != "gdal":
        raise errors.ParameterError(
            f"{tr(kind.label)} must be a raster file, not the layer {layer.name()} of the "
            f"provider {provider}; export it to a file first"
        )
    _require_crs_of_file(layer, tr(kind.label))
    return file_name(layer)


def _require_crs_of_file(layer: Any, label: str) -> None:
    given, own = layer.crs(), crs_of_file(layer)
    # One CRS may be written with and without its EPSG code.
    if given.isValid() and given != own and given.toProj() != own.toProj():
        raise errors.ParameterError(
            f"{label}: the layer {layer.name()} has the CRS {_named(given)}, but its file, which "
            f"is read, has {_named(own)}; assign the right one to the file (Raster > Projections > "
            "Assign Projection) and to the layer"
        )


def _named(crs: QgsCoordinateReferenceSystem) -> str:
    return crs.authid() or crs.description() or "none"
