"""Smooth the speckle of a radar image, and keep its edges."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import rasterio.windows
from numpy.typing import NDArray

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..errors import ParameterError, RasterContentError
from ..kinds import Choice, Number, RasterOut
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.radar_tags import with_speckle_filter
from ..rasters.reading import Mask, RasterSource, Window, bounded_cache, open_raster
from ..rasters.tiling import in_order, tiles
from ..rasters.writing import create_like, fill_value
from ..speckle.filters import FILTERS, SpeckleFilter
from ..speckle.statistics import estimate_looks
from .common import Radar, Workers, worker_count

# Looks are estimated in the middle of a large image.
_SAMPLE_PX = 2048

# Filters work in float32; its power must not overflow.
_LARGEST_AMPLITUDE = 1e18


@dataclass(frozen=True)
class SpeckleResult:
    """The filtered image, and the equivalent number of looks before and after."""

    output: Path
    filter: str
    looks: float
    looks_after: float

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "output": str(self.output),
            "filter": self.filter,
            "looks": self.looks,
            "looks_after": self.looks_after,
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [
            f"wrote {self.output}",
            f"equivalent number of looks: {self.looks:.1f}, now {self.looks_after:.0f}",
        ]


@tool(
    title="Filter speckle",
    group="Radar",
    outputs=(
        ResultOutput("LOOKS", "Equivalent number of looks", "looks"),
        ResultOutput("LOOKS_AFTER", "Equivalent number of looks of the result", "looks_after"),
    ),
)
def filter_speckle(
    input: Radar,
    output: Annotated[
        Path,
        RasterOut(
            label="Filtered image",
            help="GeoTIFF with the input's bands, data type and nodata value; complex images "
            "become amplitudes.",
        ),
    ],
    filter: Annotated[
        str,
        Choice(
            label="Filter",
            help="enhanced-frost, lee, kuan and gamma-map adapt to how much the image varies "
            "locally; isef smooths everything alike.",
            choices=tuple(FILTERS),
        ),
    ] = "enhanced-frost",
    window: Annotated[
        int,
        Number(
            label="Window",
            help="Side of the window, an odd number; isef smooths as much as the mean of it.",
            unit="px",
            integer=True,
            minimum=3,
            maximum=25,
        ),
    ] = 7,
    looks: Annotated[
        float | None,
        Number(
            label="Looks",
            help="Equivalent number of looks; by default it is estimated from the image.",
            minimum=0.5,
            maximum=10_000,
        ),
    ] = None,
    values: Annotated[
        str,
        Choice(
            label="Values",
            help="Unit of the pixels. Decibels must be made linear before.",
            choices=("amplitude", "intensity"),
        ),
    ] = "amplitude",
    damping: Annotated[
        float,
        Number(
            label="Damping",
            help="Of enhanced-frost: larger values keep more of edges, and of speckle.",
            minimum=0,
            maximum=20,
            advanced=True,
        ),
    ] = 1.0,
    workers: Workers = None,
    progress: Progress = SILENT,
) -> SpeckleResult:
    """Smooth the speckle of a radar image, and keep its edges.

    Filters work on intensity: amplitudes are squared before and the root is taken after, so that
    the mean power stays. Each band is filtered by itself; pixels without data are left out.
    """
    if window % 2 == 0:
        raise ParameterError(f"window must be an odd number, not {window}")
    with bounded_cache(), open_raster(input) as source:
        if looks is None:
            looks = _looks(source, values)
        job = _Filtering(source, SpeckleFilter(filter, window, looks, damping), values)
        with Outputs() as outputs:
            staged = outputs.stage(output)
            job.write(staged, worker_count(workers), progress)
            with open_raster(staged) as filtered:
                after = _looks(filtered, values)
    return SpeckleResult(output, filter, looks, after)


@dataclass(frozen=True)
class _Filtering:
    source: RasterSource
    filter: SpeckleFilter
    values: str

    def write(self, path: Path, workers: int, progress: Progress) -> None:
        source, places = self.source, list(tiles(self.source.grid))
        nodata = None if source.is_complex else source.bands[0].nodata
        like = _as_amplitudes(source) if source.is_complex else source
        # Without speckle, only the tag identifies it as a radar image.
        like = with_speckle_filter(like, f"{self.filter.name}, {self.filter.window_px} px")
        with (
            create_like(like, source.grid, path, nodata=nodata, workers=workers) as dataset,
            ThreadPoolExecutor(workers) as pool,
        ):
            for i, (bands, known) in enumerate(in_order(pool, self.tile, places, workers + 1)):
                place = rasterio.windows.Window(*places[i])
                dataset.write(bands, window=place)
                if source.has_mask_band:
                    dataset.write_mask(known, window=place)
                progress.update((i + 1) / len(places))

    def tile(self, tile: Window) -> tuple[NDArray[Any], Mask]:
        """Return all bands of a tile, filtered, and which pixels of the first are valid."""
        reach, source = self.filter.reach_px, self.source
        around = Window(
            tile.col - reach, tile.row - reach, tile.width + 2 * reach, tile.height + 2 * reach
        )
        inside = np.s_[:, reach : reach + tile.height, reach : reach + tile.width]
        values, valid = source.read_bands(around)
        out = np.empty_like(values[inside], dtype=np.float32 if source.is_complex else None)
        for i in range(source.count):
            out[i] = self._filtered(values[i], valid[i], i + 1, out.dtype)[inside[1:]]
        return out, valid[inside][0]

    def _filtered(
        self, values: NDArray[Any], valid: Mask, band: int, dtype: np.dtype[Any]
    ) -> NDArray[Any]:
        source = self.source
        if band == source.alpha_band:
            return values
        power = _power(values, self.values)
        filtered = self.filter(power, valid)
        if self.values == "amplitude":
            filtered = np.sqrt(filtered)
        if dtype.kind in "iu":
            limits = np.iinfo(dtype)
            filtered = np.clip(np.rint(filtered), limits.min, limits.max)
        if source.is_complex:
            return filtered
        # Without a nodata value, an invalid pixel keeps its value.
        fill = values if source.bands[band - 1].nodata is None else _fill(source, band)
        return np.where(valid, filtered.astype(dtype), fill)


def _fill(source: RasterSource, band: int) -> Any:
    return fill_value(source, source.bands[band - 1].nodata, band)


def _as_amplitudes(source: RasterSource) -> RasterSource:
    bands = tuple(replace(band, dtype="float32", nodata=None) for band in source.bands)
    return replace(source, bands=bands)


def _power(values: NDArray[Any], kind: str) -> NDArray[np.float32]:
    """Return the power of pixels, float32."""
    if values.dtype.kind == "c":
        return np.asarray(values.real**2 + values.imag**2, np.float32)
    linear = np.clip(values.astype(np.float32), 0, _LARGEST_AMPLITUDE)
    return linear * linear if kind == "amplitude" else linear


def _looks(source: RasterSource, kind: str) -> float:
    """Return the equivalent number of looks in the middle of a raster."""
    width, height = (min(size, _SAMPLE_PX) for size in (source.grid.width, source.grid.height))
    middle = Window((source.grid.width - width) // 2, (source.grid.height - height) // 2, 0, 0)
    bands, valid = source.read_bands(
        middle._replace(width=width, height=height), source.image_bands[:1]
    )
    if not valid.any():
        raise RasterContentError(f"{source.path} has no valid pixels in its middle")
    return estimate_looks(np.where(valid[0], _power(bands[0], kind), np.float32(0)), valid[0])
