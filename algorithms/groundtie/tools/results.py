"""What several tools return: a mask, a raster on a map, or a scene that was written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..declaration import Output, file_lines, given_files
from ..rasters.grid import Grid, crs_name

SHARE_OUTPUT = Output("SHARE", "Share of the pixels that take part", "share")
SIZE_OUTPUTS = (
    Output("WIDTH", "Width of the result in pixels", "width"),
    Output("HEIGHT", "Height of the result in pixels", "height"),
)


@dataclass(frozen=True)
class WrittenMask:
    """A mask that was written.

    Parameters
    ----------
    share
        Share of the pixels that take part.
    numbers
        What else is known of it, by name; None: there is none.
    words
        The same in words.
    files
        What was written, by name.
    """

    share: float
    numbers: Mapping[str, Any]
    words: str
    files: dict[str, str]

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {"share": self.share, **self.numbers, "files": self.files}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [
            f"{self.share:.1%} of the pixels take part; {self.words}",
            *file_lines(self.files),
        ]


@dataclass(frozen=True)
class WrittenRaster:
    """A raster that was written, and its grid."""

    output: Path
    grid: Grid

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "output": str(self.output),
            "width": self.grid.width,
            "height": self.grid.height,
            "pixel_size": list(self.grid.pixel_size),
            "crs": _crs_name(self.grid),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        grid = self.grid
        size = " × ".join(f"{side:g}" for side in grid.pixel_size)
        return [
            f"wrote {self.output}",
            f"grid: {grid.width} × {grid.height} pixels of {size}, {_crs_name(grid)}",
        ]


def _crs_name(grid: Grid) -> str:
    return "no CRS" if grid.crs is None else crs_name(grid.crs)


@dataclass(frozen=True)
class SimulatedScene:
    """The files of a simulated scene, by name."""

    files: Mapping[str, Path]

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {"files": given_files(self.files)}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return file_lines(self.files)
