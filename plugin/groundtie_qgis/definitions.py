"""Turns a declared parameter into the definition of a Processing parameter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import singledispatch
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingParameterBand,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterFolderDestination,
    QgsProcessingParameterMapLayer,
    QgsProcessingParameterMultipleLayers,
    QgsProcessingParameterNumber,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterString,
    QgsProcessingParameterVectorDestination,
    QgsProcessingParameterVectorLayer,
)

from . import compat
from .library import kinds
from .translation import tr
from .wording import choice_label


def qgis_name(name: str) -> str:
    """Return the name that a declared parameter or output has in Processing."""
    return name.upper()


def definition(parameter: Any) -> QgsProcessingParameterDefinition:
    """Return the Processing definition of a declared parameter."""
    made = _make(parameter.kind, parameter, qgis_name(parameter.name))
    if parameter.kind.advanced:
        made.setFlags(made.flags() | compat.ADVANCED)
    return made


def file_filter(suffixes: tuple[str, ...], any_case: bool = False) -> str:
    """Return the filter of a file dialog for files that end in `suffixes`.

    With `any_case` in capitals, too: QGIS 3.22 refuses _RPC.TXT for *.txt.
    """
    files = tr("{} files")
    endings = {s: f"*{s} *{s.upper()}" if any_case else f"*{s}" for s in suffixes}
    return ";;".join(f"{files.format(s[1:].upper())} ({endings[s]})" for s in suffixes)


# In Processing, "optional" means that a value may be absent: with a default there always is one.
def _optional(parameter: Any) -> bool:
    return not parameter.required and parameter.default is None


@singledispatch
def _make(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    raise TypeError(f"no Processing parameter for {type(kind).__name__}")


@_make.register(kinds.RasterIn)
def _raster_in(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterRasterLayer(name, tr(kind.label), optional=not parameter.required)


@_make.register(kinds.RastersIn)
def _rasters_in(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterMultipleLayers(
        name, tr(kind.label), layerType=compat.RASTER, optional=not parameter.required
    )


@_make.register(kinds.VectorIn)
def _vector_in(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterVectorLayer(
        name, tr(kind.label), types=[compat.ANY_VECTOR], optional=not parameter.required
    )


class LayerOrFile(QgsProcessingParameterMapLayer):
    """A raster or vector layer, or any file, also one that is no layer.

    Of `TypeVector` the box of QGIS 3.22 offers nothing, and alone it offers rasters, too.
    """

    def checkValueIsAcceptable(
        self, value: Any, context: QgsProcessingContext | None = None
    ) -> bool:
        is_file = isinstance(value, str) and Path(value).is_file()
        return is_file or super().checkValueIsAcceptable(value, context)

    def clone(self) -> LayerOrFile:
        copy = LayerOrFile(self.name(), self.description(), types=self.dataTypes())
        copy.fromVariantMap(self.toVariantMap())
        return copy


@_make.register(kinds.MaskIn)
def _mask_in(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return LayerOrFile(
        name,
        tr(kind.label),
        optional=not parameter.required,
        types=[compat.RASTER, compat.GEOMETRY],
    )


def takes_layers(kind: Any) -> bool:
    """Whether a parameter is a file that may hold a vector layer: tie points, control points."""
    return isinstance(kind, kinds.FileIn) and ".gpkg" in kind.suffixes


@_make.register(kinds.FileIn)
def _file_in(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    if takes_layers(kind):
        return LayerOrFile(
            name, tr(kind.label), optional=not parameter.required, types=[compat.GEOMETRY]
        )
    return QgsProcessingParameterFile(
        name,
        tr(kind.label),
        behavior=compat.FILE,
        optional=not parameter.required,
        fileFilter=file_filter(kind.suffixes, any_case=True),
    )


@_make.register(kinds.RasterOut)
def _raster_out(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterRasterDestination(name, tr(kind.label), None, *_wanted(parameter))


@_make.register(kinds.VectorOut)
def _vector_out(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterVectorDestination(
        name, tr(kind.label), compat.ANY_VECTOR, None, *_wanted(parameter)
    )


@_make.register(kinds.FileOut)
def _file_out(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterFileDestination(
        name, tr(kind.label), file_filter(kind.suffixes), None, *_wanted(parameter)
    )


@_make.register(kinds.FolderOut)
def _folder_out(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    required = parameter.required
    return QgsProcessingParameterFolderDestination(
        name, tr(kind.label), None, not required, required
    )


def _wanted(parameter: Any) -> tuple[bool, bool]:
    """Return a destination's `optional` and `createByDefault`."""
    return not parameter.required, parameter.required or parameter.kind.shown


@_make.register(kinds.Number)
def _number(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    limits = {"minValue": kind.minimum, "maxValue": kind.maximum}
    return QgsProcessingParameterNumber(
        name,
        f"{tr(kind.label)} ({kind.unit})" if kind.unit else tr(kind.label),
        type=compat.INTEGER if kind.integer else compat.DOUBLE,
        defaultValue=parameter.default,
        optional=_optional(parameter),
        **{limit: value for limit, value in limits.items() if math.isfinite(value)},
    )


class WordOrNumber(QgsProcessingParameterEnum):
    """A choice shown by labels, given by its number, its label or the command line's word."""

    def __init__(self, name: str, label: str, words: Sequence[str], **more: Any) -> None:
        super().__init__(name, label, options=[*map(choice_label, words)], **more)
        self._words = tuple(words)

    def word(self, value: Any) -> str | None:
        """Return the word of a value; None if it has none."""
        given = str(value)
        if given in self._words:
            return given
        labels = self.options()
        number = labels.index(given) if given in labels else _whole_number(given)
        return self._words[number] if 0 <= number < len(self._words) else None

    def checkValueIsAcceptable(
        self, value: Any, context: QgsProcessingContext | None = None
    ) -> bool:
        is_word = isinstance(value, (str, int)) and self.word(value) is not None
        return is_word or super().checkValueIsAcceptable(value, context)

    def clone(self) -> WordOrNumber:
        copy = WordOrNumber(self.name(), self.description(), self._words)
        copy.fromVariantMap(self.toVariantMap())
        return copy


def _whole_number(text: str) -> int:
    return int(text) if text.isascii() and text.isdigit() else -1


@_make.register(kinds.Choice)
def _choice(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    default = parameter.default
    return WordOrNumber(
        name,
        tr(kind.label),
        kind.choices,
        defaultValue=None if default is None else kind.choices.index(default),
        optional=_optional(parameter),
    )


@_make.register(kinds.Flag)
def _flag(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterBoolean(name, tr(kind.label), defaultValue=parameter.default)


@_make.register(kinds.Text)
def _text(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterString(
        name, tr(kind.label), defaultValue=parameter.default, optional=_optional(parameter)
    )


@_make.register(kinds.Crs)
def _crs(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    return QgsProcessingParameterCrs(
        name, tr(kind.label), defaultValue=parameter.default, optional=_optional(parameter)
    )


@_make.register(kinds.Band)
def _band(kind: Any, parameter: Any, name: str) -> QgsProcessingParameterDefinition:
    # QGIS 3.22 takes a band with a default for mandatory: a band is always optional.
    return QgsProcessingParameterBand(
        name,
        tr(kind.label),
        defaultValue=parameter.default,
        parentLayerParameterName=qgis_name(kind.of),
        optional=not parameter.required,
    )
