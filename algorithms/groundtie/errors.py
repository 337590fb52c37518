"""The errors that users meet; each states what is wrong, with which file, and what to do.

Every member also inherits the builtin that a caller would expect, and carries the exit code of
the command line: 2 for bad input, 3 for a refused registration.
"""

from __future__ import annotations

from typing import Any, Protocol


class GroundTieError(Exception):
    """Base of all errors that are meant for the user."""

    exit_code = 2

    def one_line(self) -> str:
        """Return the message on one line."""
        return one_line(self)


class ParameterError(GroundTieError, ValueError):
    """A parameter is missing, of the wrong type or out of its range."""


class RasterOpenError(GroundTieError, OSError):
    """A raster is missing, unreadable or truncated."""


class BandError(GroundTieError, IndexError):
    """A raster has no such band."""


class RasterContentError(GroundTieError, ValueError):
    """A raster can be read but holds nothing to match: all nodata, or constant."""


class GeoreferencingError(GroundTieError, ValueError):
    """Georeferencing is missing, contradictory or of a kind that is not supported."""


class GridSizeError(GroundTieError, ValueError):
    """A result would be larger than it can sensibly be."""


class MemoryLimitError(GroundTieError, MemoryError):
    """The request does not fit into memory."""


class NoOverlapError(GroundTieError, ValueError):
    """Two rasters do not overlap, or not enough."""


class SameFileError(GroundTieError, ValueError):
    """Two parameters that must name different files name the same one."""


class OutputError(GroundTieError, OSError):
    """An output cannot be written."""


class TransformFileError(GroundTieError, ValueError):
    """A file of a transform, of tie points or of control points cannot be understood."""


class VectorLayerError(GroundTieError, ValueError):
    """A vector layer cannot be read, or holds nothing that can be used."""


class TooFewPointsError(GroundTieError, ValueError):
    """There are fewer tie points than the model needs."""


class NothingFoundError(GroundTieError, ValueError):
    """No place was found at which the images match."""


class AmbiguousPlaceError(NothingFoundError):
    """More than one place was found at which the images match."""


class SchedulerError(GroundTieError, ConnectionError):
    """A cluster's scheduler cannot be reached or used."""


class WorkerLostError(GroundTieError, ChildProcessError):
    """The process that did the work was ended from outside, repeatedly."""


class CancelledError(GroundTieError, RuntimeError):
    """The user cancelled the work."""


class Refusal(Protocol):
    """The verdict of a refused registration: see `registration.verdict.Verdict`."""

    @property
    def rule(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def advice(self) -> str: ...
    def summary(self) -> dict[str, Any]: ...


class NotRegisteredError(GroundTieError, RuntimeError):
    """The registration was refused; `verdict` gives the reason, `tried` what else was tried."""

    exit_code = 3

    def __init__(
        self, message: str, verdict: Refusal | None = None, tried: tuple[str, ...] = ()
    ) -> None:
        super().__init__(message)
        self.verdict = verdict
        self.tried = tried

    def summary(self) -> dict[str, Any]:
        """Return the facts of the refusal as JSON values."""
        values = {} if self.verdict is None else {"verdict": self.verdict.summary()}
        return values | ({"tried": list(self.tried)} if self.tried else {})


def one_line(text: object) -> str:
    """Return a text, or what an object is as a text, on one line."""
    return " ".join(str(text).split())


def raised_by(error: Exception, package: str) -> bool:
    """Return whether an exception's class is one of a package's own.

    rasterio and fiona pass on GDAL's errors as private classes.
    """
    return type(error).__module__.partition(".")[0] == package
