"""Makes a Processing algorithm from any tool's declaration."""

from __future__ import annotations

import html
import traceback
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingFeedback,
    QgsProcessingOutputNumber,
    QgsProcessingOutputString,
)

from .definitions import definition, qgis_name
from .dependencies import complaint, missing_for, rasterio_env
from .library import errors, kinds, plugin_metadata, progress
from .pages import help_url
from .preselection import NOTHING, preselect
from .results import forget_layers, load_on_completion, show_report
from .styling import LoadedLayers, icon_of, origin
from .tool_loading import LazyTool
from .translation import tr
from .unavailable import NamedAlgorithm, UnavailableAlgorithm, broken
from .values import Reader, with_layers_as_files
from .wording import in_words


class ToolAlgorithm(NamedAlgorithm):
    """The Processing algorithm of one declared tool."""

    def __init__(self, tool: Any) -> None:
        super().__init__(tool)
        self._inputs: dict[str, Any] = {}
        # By output: the renderer of the raster that it is drawn like, and its origin.
        self._made_of: dict[str, tuple[Any, str]] = {}
        self._about = ""

    def createInstance(self) -> QgsProcessingAlgorithm:
        try:
            self._tool.parameters  # noqa: B018 - imports a lazy tool
        except ImportError as error:  # a package is there, but broken
            return UnavailableAlgorithm(self._tool, broken(error))
        return ToolAlgorithm(self._tool)

    def tags(self) -> list[str]:
        return [tag.strip() for tag in plugin_metadata().get("tags", "").split(",") if tag]

    def shortDescription(self) -> str:
        return tr(self._tool.summary)

    def shortHelpString(self) -> str:
        return help_html(self._tool)

    def helpUrl(self) -> str:
        return help_url(self.name())

    def svgIconPath(self) -> str:
        return str(icon_of(self.name()))

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:
        if isinstance(self._tool, LazyTool) and not self._tool.loaded():
            return  # the provider's own instance, from which those for runs and dialogs are made
        for parameter in self._tool.parameters:
            made = definition(parameter)
            made.setHelp(in_words(tr(parameter.kind.help), self._tool))
            self.addParameter(made)
        preselect(self, self._tool)
        for output in self._tool.outputs:
            made = QgsProcessingOutputString if output.text else QgsProcessingOutputNumber
            self.addOutput(made(qgis_name(output.name), tr(output.label)))

    def checkParameterValues(
        self, parameters: dict[str, Any], context: QgsProcessingContext
    ) -> tuple[bool, str]:
        for parameter in self._tool.parameters:
            if parameters.get(qgis_name(parameter.name)) == NOTHING:
                return False, tr("{} is missing").format(tr(parameter.kind.label))
        valid, message = super().checkParameterValues(parameters, context)
        if not valid:
            return valid, message
        scratch = QgsProcessingContext()  # so that a mere check does not load layers
        try:
            given = with_layers_as_files(self, self._tool, parameters, context)
            inputs = Reader(self, given, context, QgsProcessingFeedback())
            outputs = Reader(self, parameters, scratch, QgsProcessingFeedback())
            self._check(self._read(inputs, written=False) | self._read(outputs, written=True))
        except errors.GroundTieError as error:
            return False, error.one_line()
        return True, ""

    def prepareAlgorithm(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> bool:
        # Layers belong to this thread and must not be touched in that of `processAlgorithm`.
        try:
            given = with_layers_as_files(self, self._tool, parameters, context)
            self._inputs = self._read(Reader(self, given, context, feedback), written=False)
        except errors.GroundTieError as error:
            raise QgsProcessingException(error.one_line()) from error
        rasters = [p.name for p in self._tool.parameters if isinstance(p.kind, kinds.RasterIn)]
        # A tool of one raster makes its outputs from it, even if their values mean something else.
        only = rasters[0] if len(rasters) == 1 else ""
        for parameter in self._tool.parameters:
            like = getattr(parameter.kind, "like", "")
            source = like or only
            layer = self.parameterAsRasterLayer(parameters, qgis_name(source), context)
            if not source or layer is None:
                continue
            renderer = None
            if like:
                renderer, self._about = layer.renderer().clone(), layer.name()
            self._made_of[parameter.name] = renderer, origin(layer)
        return True

    def processAlgorithm(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        values: dict[str, Any] = {}
        try:
            outputs = Reader(self, parameters, context, feedback)
            values |= self._check(self._inputs | self._read(outputs, written=True))
            with rasterio_env():
                result = self._tool.run(**values, progress=_progress(feedback))
        except Exception as error:
            forget_layers(context, map(str, values.values()))
            if isinstance(error, errors.NotRegisteredError):
                self._show_reports(values, feedback)
            if isinstance(error, errors.GroundTieError):
                raise QgsProcessingException(error.one_line()) from error
            feedback.pushDebugInfo(traceback.format_exc())
            what = f"{type(error).__name__}: {error}"
            raise QgsProcessingException(f"this is a bug in GroundTie: {what}") from error
        # A batch can run to its end although rows of it failed.
        bad = getattr(result, "exit_code", 0) != 0
        # The dock distinguishes results from progress messages.
        push = getattr(feedback, "pushResult", feedback.pushInfo)
        for line in result.lines():
            feedback.reportError(line) if bad else push(line)
        self._finish_layers(values, context)
        return self._results(values, result.summary())

    def _read(self, reader: Reader, *, written: bool) -> dict[str, Any]:
        """Return the values of the outputs, or of all other parameters."""
        return {
            parameter.name: reader.read(parameter)
            for parameter in self._tool.parameters
            if isinstance(parameter.kind, kinds.WrittenKind) is written
        }

    def _check(self, read: dict[str, Any]) -> dict[str, Any]:
        read = read | {parameter.name: _setting(parameter) for parameter in self._tool.common}
        values = dict(self._tool.check(read, spell=lambda parameter: tr(parameter.kind.label)))
        paths = [value for value in values.values() if isinstance(value, Path)]
        if missing := missing_for(self._tool.name, paths):
            raise errors.ParameterError(complaint(missing))
        return values

    def _show_reports(self, values: dict[str, Any], feedback: QgsProcessingFeedback) -> None:
        """Show the report of a refused run, as QGIS lists no outputs of failed runs."""
        for parameter in self._tool.parameters:
            kind, path = parameter.kind, values[parameter.name]
            if isinstance(kind, kinds.FileOut) and ".html" in kind.suffixes and path is not None:
                feedback.pushInfo(f"{parameter.name}: {path}")
                show_report(tr("{}: refused").format(self.displayName()), path)

    def _finish_layers(self, values: dict[str, Any], context: QgsProcessingContext) -> None:
        """Arrange for loaded layers to be styled and grouped."""
        title = self.displayName()
        layers = LoadedLayers(f"{title}: {self._about}" if self._about else title)
        for parameter in self._tool.parameters:
            path, kind = values[parameter.name], parameter.kind
            if path is not None and isinstance(kind, (kinds.RasterOut, kinds.VectorOut)):
                layers.add(str(path), context, *self._made_of.get(parameter.name, ()))
            for name in getattr(kind, "shows", ()) if path is not None else ():
                load_on_completion(path / name, context)
                layers.add(str(path / name), context)

    def _results(self, values: dict[str, Any], summary: dict[str, Any]) -> dict[str, Any]:
        written = {
            qgis_name(parameter.name): str(values[parameter.name])
            for parameter in self._tool.parameters
            if isinstance(parameter.kind, kinds.WrittenKind) and values[parameter.name] is not None
        }
        given = {qgis_name(output.name): output.value(summary) for output in self._tool.outputs}
        return written | {name: value for name, value in given.items() if value is not None}


def _setting(parameter: Any) -> int | None:
    """Return the value that QGIS's settings give a common parameter; None: no value."""
    if parameter.name != "workers":
        return None
    most = QgsApplication.maxThreads()
    return most if most > 0 else None


def _progress(feedback: QgsProcessingFeedback) -> Any:
    """Return a progress of the library that reports to QGIS and obeys its Cancel button."""
    last_message = ""

    def report(fraction: float, message: str) -> None:
        nonlocal last_message
        feedback.setProgress(100 * fraction)
        if message and message != last_message:
            last_message = message
            heard = feedback.pushWarning if message.startswith("warning: ") else feedback.pushInfo
            heard(message)

    return progress.Progress(report, feedback.isCanceled)


def help_html(tool: Any) -> str:
    """Return the help of a tool and of its parameters as HTML."""

    def worded(text: str) -> str:
        return _escaped(in_words(tr(" ".join(text.split())), tool))

    paragraphs = [tool.summary, *tool.description.split("\n\n")]
    parts = [f"<p>{worded(text)}</p>" for text in paragraphs if text]
    rows = [
        f"<p><b>{_escaped(tr(p.kind.label))}</b>: {worded(p.kind.help)}</p>"
        for p in tool.parameters
    ]
    heading = [f"<h3>{tr('Parameters')}</h3>"] if rows else []
    return "\n".join([*parts, *heading, *rows])


def _escaped(text: str) -> str:
    return html.escape(" ".join(text.split()), quote=False)
