"""The kinds of parameters that tools have, and what makes a value of each kind valid."""

from __future__ import annotations

import errno
import math
import os
import reprlib
import stat
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .errors import GroundTieError, ParameterError
from .raster_names import GEOTIFF, is_utf8, raster_name, require_possible
from .stac_items import raster_of_item
from .tables import plain_number

# The choice, of a model or a mask as of anything else, that the data decide.
AUTO = "auto"

# Endings of the files that state the view of an image: STAC items and products' metadata.
VIEW_FILES = (".json", ".xml", ".imd")

# Format of a report's numbers.
REPORT_FORMAT = "groundtie-report/1"


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What every kind has: a label and a help text.

    The label that dialogs show is by default the parameter's name in words. `advanced` parameters
    are folded away in dialogs; `option` makes a required parameter an option with a name on the
    command line instead of a positional argument. One that is `optional_in_python` is required by
    the command line and QGIS, which can only write files; Python's callers may leave it out (its
    default is None) and go on with what is returned. What is `common` means the same for all tools
    and decides no result: it is none of a tool's own parameters; the command line takes it before
    the tool's name, too, and QGIS has a setting.
    """

    label: str = ""
    help: str
    advanced: bool = False
    option: bool = False
    optional_in_python: bool = False
    common: bool = False

    @property
    def form(self) -> str:
        """Values in words, for the documentation of a function; empty: any that the help names."""
        return ""

    def check(self, name: str, value: Any) -> Any:
        """Return `value` in the type that tools work with, or raise `ParameterError`."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class PathKind(Kind):
    """A path; the value is a `pathlib.Path`."""

    def check(self, name: str, value: Any) -> Path:
        _named(name, value)
        path = Path(value)
        _mode(name, path)  # so that whatever cannot be a name is found here
        return path


class InputKind(PathKind):
    """A file that is read; neither a pipe, which may never end, nor a device."""

    def check(self, name: str, value: Any) -> Any:
        return _readable(name, super().check(name, value))


class WrittenKind(PathKind):
    """A file or a folder that is written."""

    def also_written(self, path: Path) -> tuple[Path, ...]:
        """Return the files that are written because of an output `path` besides this itself."""
        return ()


@dataclass(frozen=True, kw_only=True)
class OutputKind(WrittenKind):
    """A file that is written; `suffixes` are the endings it may have, the usual one first.

    What is `shown` can be looked at: dialogs have it made even if it is not asked for.
    """

    suffixes: tuple[str, ...]
    shown: bool = False

    def check(self, name: str, value: Any) -> Path:
        path = super().check(name, value)
        if path.suffix.lower() not in self.suffixes:
            raise ParameterError(f"{name} must end in {' or '.join(self.suffixes)}: {path}")
        return path


@dataclass(frozen=True, kw_only=True)
class RasterIn(InputKind):
    """A raster that is read: a path, or text of GDAL's own names (`/vsi…`, `DRIVER:…`).

    URLs and assets of STAC items (`item.json#asset`) become these. In Python a raster may be in
    memory, too (see `arrays.in_memory`), unless it `must_have_name`: the tool goes by that.
    """

    must_have_name: bool = False

    def check(self, name: str, value: Any) -> Any:
        if self.must_have_name:
            _named(name, value)
        return _raster(name, value)


@dataclass(frozen=True, kw_only=True)
class RastersIn(Kind):
    """One or several rasters that are read, or files, folders and patterns that stand for them.

    The value is a tuple of paths; GDAL's own names stay text.
    """

    def check(self, name: str, value: Any) -> tuple[Any, ...]:
        given = (value,) if isinstance(value, (str, os.PathLike)) else value
        if not isinstance(given, (list, tuple)):
            raise ParameterError(f"{name} must be paths, not {_shown(value)}")
        if not given:
            raise ParameterError(f"{name} is missing")
        return tuple(_readable(name, _named(name, one)) for one in given)


class VectorIn(InputKind):
    """A vector layer that is read; GDAL's own names and URLs as for `RasterIn`."""

    def check(self, name: str, value: Any) -> Any:
        return _readable(name, _named(name, value))


class MaskIn(InputKind):
    """A raster, a vector layer or a file that states what of an image takes part.

    In Python a raster may be in memory, as for `RasterIn`. A `.json` alone is a classifier; with
    `#asset` it is a STAC item.
    """

    def check(self, name: str, value: Any) -> Any:
        is_text = isinstance(value, (str, os.PathLike))
        if is_text and "#" not in os.fspath(value):
            return _readable(name, _named(name, value))
        return _raster(name, value)


@dataclass(frozen=True, kw_only=True)
class SurfaceIn(MaskIn):
    """A raster of heights, or a vector layer of buildings with theirs, named as masks are."""


@dataclass(frozen=True, kw_only=True)
class FileIn(InputKind):
    """Any other file that is read."""

    suffixes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class RasterOut(OutputKind):
    """A raster that is written; its values mean what those of the raster parameter `like` mean."""

    suffixes: tuple[str, ...] = GEOTIFF
    like: str = ""


@dataclass(frozen=True, kw_only=True)
class VectorOut(OutputKind):
    """A vector layer of points that is written; QGIS draws its lines as those of tie points."""

    suffixes: tuple[str, ...] = (".gpkg", ".geojson")


@dataclass(frozen=True, kw_only=True)
class FileOut(OutputKind):
    """Any other file that is written; a report has its `numbers` put beside it as JSON."""

    numbers: bool = False

    def also_written(self, path: Path) -> tuple[Path, ...]:
        """Return the JSON beside the file."""
        return (path.with_suffix(".json"),) if self.numbers else ()


@dataclass(frozen=True, kw_only=True)
class FolderOut(WrittenKind):
    """A folder that is written into, made if it is missing.

    Of what comes into it, rasters of the names `shows` can be looked at: the first on top. A tool
    that reads files, too, states the names that it `writes`.
    """

    shows: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def also_written(self, path: Path) -> tuple[Path, ...]:
        """Return the files in the folder."""
        return tuple(path / name for name in self.writes)


@dataclass(frozen=True, kw_only=True)
class Number(Kind):
    """A number within a range, with its unit; `integer` allows whole numbers only."""

    unit: str = ""
    minimum: float = -math.inf
    maximum: float = math.inf
    integer: bool = False

    @property
    def form(self) -> str:
        return ", ".join(filter(None, (self.unit, self.range_text)))

    def check(self, name: str, value: Any) -> float:
        try:
            if isinstance(value, bool):
                raise TypeError
            number = plain_number(value)
        except (TypeError, ValueError, OverflowError):
            raise ParameterError(f"{name} must be a number, not {value!r}") from None
        if not math.isfinite(number):
            raise ParameterError(f"{name} must be a finite number, not {value}")
        if not self.minimum <= number <= self.maximum:
            bounds = f"{self.range_text} {self.unit}".rstrip()
            raise ParameterError(f"{name} must be {bounds}, not {number:.15g}")
        if not self.integer:
            return number
        if number != int(number):
            raise ParameterError(f"{name} must be a whole number, not {number:.15g}")
        return value if isinstance(value, int) else int(number)

    @property
    def range_text(self) -> str:
        """The range in words, without the unit; empty if any number will do."""
        if math.isfinite(self.minimum) and math.isfinite(self.maximum):
            return f"{self.minimum:.15g} to {self.maximum:.15g}"
        if math.isfinite(self.minimum):
            return f"at least {self.minimum:.15g}"
        return f"at most {self.maximum:.15g}" if math.isfinite(self.maximum) else ""


@dataclass(frozen=True, kw_only=True)
class Distance(Number):
    """A distance on the ground, in metres (in pixels where images have no georeferencing)."""

    unit: str = "m"
    minimum: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Choice(Kind):
    """One of several words; tools' names among them may have hyphens, as on the command line."""

    choices: tuple[str, ...]

    @property
    def form(self) -> str:
        return ", ".join(self.choices)

    def check(self, name: str, value: Any) -> str:
        for word in (value.replace("-", "_"), value) if isinstance(value, str) else ():
            if word in self.choices:
                return word
        raise ParameterError(
            f"{name} must be one of {', '.join(self.choices)}, not {_shown(value)}"
        )


class Flag(Kind):
    """Yes or no."""

    def check(self, name: str, value: Any) -> bool:
        if not isinstance(value, bool):
            raise ParameterError(f"{name} must be true or false, not {value!r}")
        return value


class Text(Kind):
    """Any text."""

    def check(self, name: str, value: Any) -> str:
        if not isinstance(value, str):
            raise ParameterError(f"{name} must be a text, not {value!r}")
        if not is_utf8(value):
            raise ParameterError(f"{name} must be a text in UTF-8, not {value!a}")
        return value


class Views(Text):
    """Views of images, separated by semicolons: in words, or by the files that state them."""

    def files_named(self, value: str | None) -> tuple[Path, ...]:
        """Return the files among the views of a checked value."""
        return tuple(Path(view) for view in views_in(value) if is_view_file(view))

    def located(self, value: str, folder: Path) -> str:
        """Return the views with relative paths of their files beginning at a folder."""
        views = views_in(value)
        return "; ".join(str(folder / view) if is_view_file(view) else view for view in views)


def views_in(words: str | None) -> list[str]:
    """Return the views in a text, the reference's first; empty where one is left out."""
    return [view.strip() for view in (words or "").split(";")]


def is_view_file(view: str) -> bool:
    """Return whether a view is the name of a file that states it."""
    return view.lower().endswith(VIEW_FILES)


class Crs(Text):
    """A coordinate reference system: an authority's code or WKT."""


@dataclass(frozen=True, kw_only=True)
class Band(Kind):
    """The number of a band, from 1, of the raster that the parameter `of` names."""

    of: str

    def check(self, name: str, value: Any) -> int:
        number = Number(label=self.label, help=self.help, minimum=1, integer=True)
        return int(number.check(name, value))


def _named(name: str, value: Any) -> Path | str:
    """Return a path or GDAL's own name; `ParameterError` for what is neither."""
    if not isinstance(value, (str, os.PathLike)) or not os.fspath(value):
        raise ParameterError(f"{name} must be a path, not {_shown(value)}")
    require_possible(name, os.fspath(value))
    found = raster_name(value)
    if isinstance(found, Path):
        # Libraries and results take whole paths: the working folder is a part of the name.
        require_possible(name, os.path.abspath(found))
    return found


def _readable(name: str, found: Path | str) -> Path | str:
    """Return a path if it may be read, or GDAL's own name; `ParameterError` for other paths."""
    mode = None if isinstance(found, str) else _mode(name, found)
    if mode is not None and not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise ParameterError(f"{name} is neither a file nor a folder: {found}")
    return found


def _raster(name: str, value: Any) -> Any:
    """Return what may be a raster: a path, GDAL's name, an asset of a STAC item, one in memory."""
    if not isinstance(value, (str, os.PathLike)):
        return _in_memory(name, value)
    found = raster_of_item(_named(name, value))
    return _readable(name, _named(name, found))


def _shown(value: Any) -> str:
    """Return what stands for a wrong value in one line: arrays show theirs in many."""
    return f"{' '.join(reprlib.repr(value).split()):.60}"


def _mode(name: str, path: str | Path) -> int | None:
    """Return what kind of thing a path is, as `os.stat` has it; None if there is none.

    Raises
    ------
    ParameterError
        Nothing can have that name: it is too long.
    """
    try:
        return os.stat(path).st_mode
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise ParameterError(
                f"{name} has a name that is too long: {str(path)[:60]}…"
            ) from error
        return None


def _in_memory(name: str, value: Any) -> Any:
    from .arrays import in_memory  # numpy is not loaded for the command line's help

    try:
        held = in_memory(value)
    except GroundTieError as error:
        raise ParameterError(f"{name}: {error}") from error
    if held is None:
        raise ParameterError(
            f"{name} must be a path, an open dataset or an array, not {reprlib.repr(value):.60}"
        )
    # Of two arrays, messages name the one that they mean.
    return replace(held, called=name) if hasattr(held, "called") else held


def shown_name(value: Any) -> Any:
    """Return a checked value as reports show it: rasters in memory by what they are called."""
    in_memory = not isinstance(value, (str, os.PathLike)) and hasattr(value, "crs")
    return value.name if in_memory else value


def plain(value: Any) -> Any:
    """Return a value as JSON can carry it: what is not finite is None, what is no value text."""
    import numpy as np  # not loaded for the command line's help

    if isinstance(value, dict):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(shown_name(value))
