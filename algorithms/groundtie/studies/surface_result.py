"""The result of a study of one window's similarity, and its output files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..context import Context
from ..declaration import file_lines, given_files
from ..rasters.atomic import Outputs, write_figure, write_json
from ..rasters.grid import Grid
from ..rasters.writing import write_raster
from ..similarity.peak import Peak, find_peak
from ..similarity.surface import Surface
from .window_surface import SurfaceSettings, Window, second_peak


@dataclass(frozen=True)
class SurfaceResult:
    """A surface and its peaks.

    Parameters
    ----------
    similarity
        The measure.
    values
        Values of the measure over shifts, shape (2 r + 1, 2 r + 1), shift 0 at the centre; NaN
        where the overlap is too small. For fused, which has no values of its own, the deviations.
    deviations
        The detrended surface in robust standard deviations, in which peaks are found.
    grid
        Georeferencing of the surface: the pixel of a shift lies at the window's centre moved by
        that shift.
    peak, second
        The highest peak, and the highest separate peak; None if there is none.
    chip_px
        Side of the window.
    files
        Paths of the output files, by name.
    """

    similarity: str
    values: Surface
    deviations: Surface
    grid: Grid
    peak: Peak
    second: Peak | None
    chip_px: int
    files: dict[str, str]

    @classmethod
    def measured(
        cls,
        window: Window,
        settings: SurfaceSettings,
        files: dict[str, Path | None],
        context: Context,
    ) -> SurfaceResult:
        """Measure the similarity of a window over shifts, and find the peaks."""
        patches = window.read()
        context.update(0.1, "measuring similarity")
        values, deviations = settings.surfaces(*patches, window.radius_px, context.part(0.1, 1.0))
        peak = find_peak(deviations)
        return cls(
            settings.similarity,
            values,
            deviations,
            window.grid(window.radius_px),
            peak,
            second_peak(deviations, peak),
            window.chip_px,
            given_files(files),
        )

    def write(self) -> None:
        """Write all files."""
        with Outputs() as outputs:
            staged = {name: outputs.stage(Path(path)) for name, path in self.files.items()}
            bands = np.stack([self.values, self.deviations])
            names = self.similarity, "robust standard deviations"
            write_raster(staged["output"], bands, self.grid, names, nodata=float("nan"))
            if "picture" in staged:
                _draw(staged["picture"], self)
            if "numbers" in staged:
                write_json(staged["numbers"], self.summary())

    @property
    def second_ratio(self) -> float | None:
        """Height of the second peak as a share of the first's; None without a second peak."""
        return None if self.second is None else self.second.height / self.peak.height

    def summary(self) -> dict[str, Any]:
        """Return the result as JSON-compatible values."""
        x, y = self.grid.pixel_to_map([self.grid.centre_px])[0]
        return {
            "similarity": self.similarity,
            "window": {
                "x": float(x),
                "y": float(y),
                "chip_px": self.chip_px,
                "radius_px": self.grid.width // 2,
                "pixel_size_m": self.grid.pixel_size_m,
            },
            "peak": self._numbers(self.peak),
            "second_peak": None if self.second is None else self._numbers(self.second),
            "second_ratio": self.second_ratio,
            "files": self.files,
        }

    def _numbers(self, peak: Peak) -> dict[str, Any]:
        centre = np.array(self.grid.centre_px)
        x, y = self.grid.pixel_to_map([centre + peak.shift_px])[0]
        col, row = np.rint(centre + peak.shift_px).astype(int)
        value = float(self.values[row, col])
        return {
            "right_px": peak.shift_px[0],
            "down_px": peak.shift_px[1],
            "x": float(x),
            "y": float(y),
            "value": value if np.isfinite(value) else None,
            "height": peak.height,
            "covariance_px2": peak.covariance_px2.tolist(),
            "at_border": peak.at_border,
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        right, down = self.peak.shift_px
        sigma = np.sqrt(np.diag(self.peak.covariance_px2))
        lines = [
            f"peak: {right:+.2f} px right, {down:+.2f} px down "
            f"(standard deviations {sigma[0]:.2f}, {sigma[1]:.2f} px)",
            f"height: {self.peak.height:.1f} robust standard deviations",
        ]
        if self.peak.at_border:
            lines.append("the peak lies at the border of the search: it may be no peak")
        if self.second is not None:
            right, down = self.second.shift_px
            lines.append(
                f"second peak: {right:+.2f} px right, {down:+.2f} px down, "
                f"{self.second_ratio:.2f} of the first's height"
            )
        return lines + file_lines(self.files)


def _draw(path: Path, result: SurfaceResult) -> None:
    """Draw a surface with its peaks as a PNG."""
    from matplotlib.figure import Figure

    edge = result.grid.width / 2
    figure = Figure(figsize=(6.4, 5.2), layout="constrained")
    axes = figure.add_subplot()
    image = axes.imshow(result.values, extent=(-edge, edge, edge, -edge), cmap="viridis")
    figure.colorbar(image, label=result.similarity)
    axes.plot(*result.peak.shift_px, "o", mfc="none", mec="red", ms=14, mew=1.8, label="peak")
    if result.second is not None:
        axes.plot(*result.second.shift_px, "s", mfc="none", mec="white", ms=10, label="second peak")
    # Rows increase downwards, as on the map.
    axes.set(xlabel="to the right (px)", ylabel="downwards (px)")
    axes.legend(loc="upper right", framealpha=0.7)
    right, down = result.peak.shift_px
    axes.set_title(f"peak at {right:+.2f}, {down:+.2f} px, height {result.peak.height:.1f}")
    write_figure(path, figure, 150)
