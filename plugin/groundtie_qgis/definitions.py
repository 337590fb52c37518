"""Makes the definition of a Processing parameter from a declared parameter."""

from __future__ import annotations

import glob
import math
import os
from collections.abc import Callable, Sequence
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

# A definition class, and its arguments besides name and label.
Made = tuple[Callable[..., QgsProcessingParameterDefinition], dict[str, Any]]


def qgis_name(name: str) -> str:
    """Return the name that a declared parameter or output has in Processing."""
    return name.upper()


def definition(parameter: Any) -> QgsProcessingParameterDefinition:
    """Return the Processing definition of a declared parameter."""
    kind = parameter.kind
    unit = getattr(kind, "unit", "")
    label = f"{tr(kind.label)} ({unit})" if unit else tr(kind.label)
    make, options = _made_of(kind, parameter)
    made = make(qgis_name(parameter.name), label, **options)
    if kind.advanced:
        made.setFlags(made.flags() | compat.ADVANCED)
    return made


def file_filter(suffixes: tuple[str, ...], any_case: bool = False) -> str:
    """Return the filter of a file dialog for files that end in `suffixes`.

    `any_case` adds the suffixes in capitals, as QGIS 3.22 refuses _RPC.TXT for *.txt.
    """
    files = tr("{} files")
    endings = {s: f"*{s} *{s.upper()}" if any_case else f"*{s}" for s in suffixes}
    return ";;".join(f"{files.format(s[1:].upper())} ({endings[s]})" for s in suffixes)


def _optional(parameter: Any) -> dict[str, Any]:
    return {"optional": not parameter.required}


def _default(parameter: Any) -> dict[str, Any]:
    # In Processing, "optional" means that a value may be absent; with a default, it never is.
    is_absent = not parameter.required and parameter.default is None
    return {"defaultValue": parameter.default, "optional": is_absent}


def _destination(parameter: Any) -> dict[str, Any]:
    is_shown = getattr(parameter.kind, "shown", False)
    return {**_optional(parameter), "createByDefault": parameter.required or is_shown}


@singledispatch
def _made_of(kind: Any, parameter: Any) -> Made:
    """Return the class of a parameter's definition, and its arguments besides name and label."""
    raise TypeError(f"no Processing parameter for {type(kind).__name__}")


@_made_of.register(kinds.RasterIn)
def _raster_in(kind: Any, parameter: Any) -> Made:
    return QgsProcessingParameterRasterLayer, _optional(parameter)


class LayersOrNames(QgsProcessingParameterMultipleLayers):
    """Layers, or files, folders and patterns, even if they are not layers."""

    def checkValueIsAcceptable(
        self, value: Any, context: QgsProcessingContext | None = None
    ) -> bool:
        given = value if isinstance(value, (list, tuple)) else [value]
        others = [one for one in given if not (isinstance(one, str) and _is_there(one))]
        if len(others) == len(given):
            return super().checkValueIsAcceptable(value, context)
        return not others or super().checkValueIsAcceptable(others, context)

    def clone(self) -> LayersOrNames:
        copy = LayersOrNames(self.name(), self.description(), self.layerType())
        copy.fromVariantMap(self.toVariantMap())
        return copy


def _is_there(name: str) -> bool:
    """Whether a name is that of a file or folder, or a pattern that matches one."""
    return os.path.exists(name) or any(glob.iglob(name))


@_made_of.register(kinds.RastersIn)
def _rasters_in(kind: Any, parameter: Any) -> Made:
    return LayersOrNames, {"layerType": compat.RASTER, **_optional(parameter)}


@_made_of.register(kinds.VectorIn)
def _vector_in(kind: Any, parameter: Any) -> Made:
    return QgsProcessingParameterVectorLayer, {"types": [compat.ANY_VECTOR], **_optional(parameter)}


class LayerOrFile(QgsProcessingParameterMapLayer):
    """A raster or vector layer, or any file, even if it is not a layer.

    The box of QGIS 3.22 offers nothing for `TypeVector`, and rasters, too, if it is the only type.
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


@_made_of.register(kinds.MaskIn)
def _mask_in(kind: Any, parameter: Any) -> Made:
    return LayerOrFile, {"types": [compat.RASTER, compat.GEOMETRY], **_optional(parameter)}


def takes_layers(kind: Any) -> bool:
    """Whether a parameter is a file that may be a vector layer, as of tie or control points."""
    return isinstance(kind, kinds.FileIn) and ".gpkg" in kind.suffixes


@_made_of.register(kinds.FileIn)
def _file_in(kind: Any, parameter: Any) -> Made:
    if takes_layers(kind):
        return LayerOrFile, {"types": [compat.GEOMETRY], **_optional(parameter)}
    files = {"behavior": compat.FILE, "fileFilter": file_filter(kind.suffixes, any_case=True)}
    return QgsProcessingParameterFile, {**files, **_optional(parameter)}


@_made_of.register(kinds.RasterOut)
def _raster_out(kind: Any, parameter: Any) -> Made:
    return QgsProcessingParameterRasterDestination, _destination(parameter)


@_made_of.register(kinds.VectorOut)
def _vector_out(kind: Any, parameter: Any) -> Made:
    options = {"type": compat.ANY_VECTOR, **_destination(parameter)}
    return QgsProcessingParameterVectorDestination, options


@_made_of.register(kinds.FileOut)
def _file_out(kind: Any, parameter: Any) -> Made:
    options = {"fileFilter": file_filter(kind.suffixes), **_destination(parameter)}
    return QgsProcessingParameterFileDestination, options


@_made_of.register(kinds.FolderOut)
def _folder_out(kind: Any, parameter: Any) -> Made:
    return QgsProcessingParameterFolderDestination, _destination(parameter)


@_made_of.register(kinds.Number)
def _number(kind: Any, parameter: Any) -> Made:
    limits = {"minValue": kind.minimum, "maxValue": kind.maximum}
    return QgsProcessingParameterNumber, {
        "type": compat.INTEGER if kind.integer else compat.DOUBLE,
        **_default(parameter),
        **{limit: value for limit, value in limits.items() if math.isfinite(value)},
    }


class WordOrNumber(QgsProcessingParameterEnum):
    """A choice shown by labels; its value is a number, a label or a word of the command line."""

    def __init__(self, name: str, label: str, words: Sequence[str], **more: Any) -> None:
        super().__init__(name, label, options=[*map(choice_label, words)], **more)
        self._words = tuple(words)

    def word(self, value: Any) -> str | None:
        """Return the word for a value; None if there is none."""
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


@_made_of.register(kinds.Choice)
def _choice(kind: Any, parameter: Any) -> Made:
    options = {"words": kind.choices, **_default(parameter)}
    if parameter.default is not None:
        options["defaultValue"] = kind.choices.index(parameter.default)
    return WordOrNumber, options


@_made_of.register(kinds.Flag)
def _flag(kind: Any, parameter: Any) -> Made:
    return QgsProcessingParameterBoolean, {"defaultValue": parameter.default}


@_made_of.register(kinds.Text)
def _text(kind: Any, parameter: Any) -> Made:
    return QgsProcessingParameterString, _default(parameter)


@_made_of.register(kinds.Crs)
def _crs(kind: Any, parameter: Any) -> Made:
    return QgsProcessingParameterCrs, _default(parameter)


@_made_of.register(kinds.Band)
def _band(kind: Any, parameter: Any) -> Made:
    # QGIS 3.22 treats a band with a default as mandatory, so a band is always optional.
    return QgsProcessingParameterBand, {
        "defaultValue": parameter.default,
        "parentLayerParameterName": qgis_name(kind.of),
        **_optional(parameter),
    }
