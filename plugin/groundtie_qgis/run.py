"""Runs GroundTie's algorithms in the background for the dock, and returns their outcomes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsProcessingAlgRunnerTask,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingOutputLayerDefinition,
    QgsProcessingUtils,
    QgsProject,
)

from .translation import tr


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run.

    Parameters
    ----------
    succeeded
        Whether the run succeeded.
    reason
        Why it did not, in one line.
    lines
        The tool's statements about its result.
    files
        Written files, by parameter.
    """

    succeeded: bool
    reason: str = ""
    lines: tuple[str, ...] = ()
    files: dict[str, Path] = field(default_factory=dict)


class Listener(QgsProcessingFeedback):
    """Collects a run's statements about its result, and its errors."""

    def __init__(self) -> None:
        super().__init__(False)
        self.lines: list[str] = []
        self.errors: list[str] = []

    def pushResult(self, line: str) -> None:
        """Collect a line of the result (called by the algorithms of tools)."""
        self.lines.append(line)

    def reportError(self, error: str, fatalError: bool = False) -> None:
        self.errors.append(error)


class Run:
    """One run of an algorithm in the background.

    Parameters
    ----------
    tool
        Name of the tool.
    values
        Values of its parameters.
    files
        Files to be written, by parameter.
    layers
        Parameters whose files are loaded into the map.
    done
        Called with the `Outcome`, in the main thread.
    progress
        Called with the progress in per cent.
    """

    def __init__(
        self,
        tool: str,
        values: dict[str, Any],
        files: dict[str, Path],
        layers: tuple[str, ...],
        done: Callable[[Outcome], None],
        progress: Callable[[float], None],
    ) -> None:
        registry = QgsApplication.processingRegistry()
        self._algorithm = registry.createAlgorithmById(f"groundtie:{tool}")
        self._files, self._done = files, done
        project = QgsProject.instance()
        self._context = QgsProcessingContext()
        self._context.setProject(project)
        self._feedback = Listener()
        self._feedback.progressChanged.connect(progress)
        self._values = dict(values)
        for name, path in files.items():
            loaded = QgsProcessingOutputLayerDefinition(str(path), project)
            self._values[name] = loaded if name in layers else str(path)

    def start(self) -> None:
        """Start if the values are valid; otherwise the outcome states the error."""
        able, why = self._algorithm.canExecute()
        valid = False
        if able:
            valid, why = self._algorithm.checkParameterValues(self._values, self._context)
        if not valid:
            self._done(Outcome(False, why))
            return
        self._task = QgsProcessingAlgRunnerTask(
            self._algorithm, self._values, self._context, self._feedback
        )
        self._task.executed.connect(self._end)
        # Keeps context and feedback alive, which the task uses but does not own: QGIS would crash.
        self._task.setProperty("run", self)
        QgsApplication.taskManager().addTask(self._task)

    def cancel(self) -> None:
        """Stop at the next step."""
        self._feedback.cancel()

    def _end(self, succeeded: bool, results: dict[str, Any]) -> None:
        if succeeded:
            from processing.gui.Postprocessing import handleAlgorithmResults

            handleAlgorithmResults(self._algorithm, self._context, self._feedback)
        files = {name: path for name, path in self._files.items() if path.is_file()}
        errors = self._feedback.errors
        reason = (
            "" if succeeded else (errors[0] if errors else tr("cancelled; nothing was written"))
        )
        self._done(Outcome(succeeded, reason, tuple(self._feedback.lines), files))
        self._task.setProperty("run", None)


def new_file(name: str) -> Path:
    """Return an unused path in QGIS's temporary folder."""
    return Path(QgsProcessingUtils.generateTempFilename(name))
