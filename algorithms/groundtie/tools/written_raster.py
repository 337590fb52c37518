"""What tools that write a raster on a map return, and the parameters of its grid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..declaration import Output
from ..kinds import Distance, RasterIn
from ..rasters.grid import Grid

SIZE_OUTPUTS = (
    Output("WIDTH", "Width of the result in pixels", "width"),
    Output("HEIGHT", "Height of the result in pixels", "height"),
)


def like_reference(otherwise: str) -> RasterIn:
    """Return the kind of the raster whose grid the result gets."""
    help = "The result gets exactly the grid of this raster, so that the two stack. By default the "
    return RasterIn(label="Reference image", help=f"{help}result covers all of the {otherwise}.")


def pixel_size_of_result(otherwise: str) -> Distance:
    """Return the kind of the result's pixel size."""
    return Distance(label="Pixel size", help=f"Pixel size of the result{otherwise}.", minimum=1e-6)


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
            "crs": crs_name(self.grid),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        grid = self.grid
        size = " × ".join(f"{side:g}" for side in grid.pixel_size)
        return [
            f"wrote {self.output}",
            f"grid: {grid.width} × {grid.height} pixels of {size}, {crs_name(grid)}",
        ]


def crs_name(grid: Grid) -> str:
    """Return the name of a grid's CRS."""
    return "no CRS" if grid.crs is None else str(grid.crs.to_string())
