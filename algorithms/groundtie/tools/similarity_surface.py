"""The similarity surface of one window: what a measure says of every shift."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import rasterio
from numpy.typing import NDArray

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..errors import NoOverlapError, ParameterError
from ..kinds import Choice, Distance, FileOut, Number, RasterOut
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs, writing
from ..rasters.grid import Grid
from ..rasters.pair import Image, ImagePair, make_pair
from ..rasters.reading import RasterSource, bounded_cache, open_raster
from ..rasters.writing import BLOCK, check_complete
from ..similarity.binning import BINNINGS
from ..similarity.peak import Evidence, find_peak
from ..similarity.surface import Surface
from ..studies.window_surface import CHOICES, GREY_VALUES, SurfaceSettings, Window, second_peak
from .common import (
    GpveOrder,
    Input,
    InputBand,
    InputMask,
    MatchingPixelSize,
    Reference,
    ReferenceBand,
    ReferenceMask,
    Seed,
    Workers,
    worker_count,
)

_DEFAULT_RADIUS_PX, _LARGEST_RADIUS_PX = 20, 100


@dataclass(frozen=True)
class SurfaceResult:
    """What a surface says.

    Parameters
    ----------
    similarity
        The measure.
    values
        Its values over shifts, shape (2 r + 1, 2 r + 1), centre shift 0; NaN where too little
        overlaps. For fused, which has no values of its own, the evidence.
    evidence
        The surface in robust standard deviations, without its slow trend; in it peaks are found.
    grid
        Where the surface's pixels lie: that of a shift lies where the window's centre, so
        shifted, lies.
    peak, second
        The highest peak, and the highest one elsewhere; None if there is none.
    chip_px
        Side of the window.
    files
        What was written, by name.
    """

    similarity: str
    values: Surface
    evidence: Surface
    grid: Grid
    peak: Evidence
    second: Evidence | None
    chip_px: int
    files: dict[str, str]

    @property
    def second_ratio(self) -> float | None:
        """Height of the second peak as a share of the first's; None without a second."""
        return None if self.second is None else self.second.height / self.peak.height

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
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
            "peak": self._told(self.peak),
            "second_peak": None if self.second is None else self._told(self.second),
            "second_ratio": self.second_ratio,
            "files": self.files,
        }

    def _told(self, peak: Evidence) -> dict[str, Any]:
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
        return [*lines, *(f"{name}: {path}" for name, path in self.files.items())]


@tool(
    title="Similarity surface",
    group="Quality",
    outputs=(
        ResultOutput("PEAK_RIGHT_PX", "Peak to the right (px)", "peak.right_px"),
        ResultOutput("PEAK_DOWN_PX", "Peak downwards (px)", "peak.down_px"),
        ResultOutput("PEAK_HEIGHT", "Height of the peak (standard deviations)", "peak.height"),
        ResultOutput("SECOND_RATIO", "Second peak's share of the height", "second_ratio"),
    ),
)
def similarity_surface(
    reference: Reference,
    input: Input,
    output: Annotated[
        Path,
        RasterOut(
            label="Similarity surface",
            help="GeoTIFF with a pixel for every shift; its first band has the measure's values, "
            "the second one robust standard deviations from the slow trend.",
        ),
    ],
    centre_x: Annotated[
        float | None,
        Number(
            label="Centre x",
            help="Where the window's centre lies, in the CRS of the reference; by default the "
            "middle of the overlap.",
        ),
    ] = None,
    centre_y: Annotated[
        float | None, Number(label="Centre y", help="See the centre's x; give both or none.")
    ] = None,
    chip_size: Annotated[
        int,
        Number(
            label="Chip size",
            help="Side of the window, in pixels of the matching grid; even numbers get one more.",
            unit="px",
            integer=True,
            minimum=16,
            maximum=1024,
        ),
    ] = 101,
    search_radius: Annotated[
        float | None,
        Distance(
            label="Search radius",
            help=f"Largest shift; by default {_DEFAULT_RADIUS_PX} pixels of the matching grid, "
            f"and at most {_LARGEST_RADIUS_PX}.",
        ),
    ] = None,
    similarity: Annotated[
        str,
        Choice(
            label="Similarity",
            help="What is measured: fused (nmi and orientation), mutual information normalised "
            "(nmi) or not (mi), by Rényi's or Tsallis' entropy or by a density ratio (mlmi), the "
            "orientation of edges, correlation of grey values (ncc), cluster reward or "
            "correlation ratio.",
            choices=CHOICES,
        ),
    ] = "fused",
    picture: Annotated[
        Path | None,
        FileOut(
            label="Picture", help="The surface with its peaks, to look at.", suffixes=(".png",)
        ),
    ] = None,
    numbers: Annotated[
        Path | None,
        FileOut(
            label="Numbers",
            help="Peak, its sub-pixel position and covariance, and the second peak.",
            suffixes=(".json",),
        ),
    ] = None,
    alpha: Annotated[
        float,
        Number(
            label="Order of Rényi's entropy",
            help="For renyi; 1 is Shannon's entropy.",
            minimum=-100,
            maximum=100,
            advanced=True,
        ),
    ] = 2.0,
    q: Annotated[
        float,
        Number(
            label="Index of Tsallis' entropy",
            help="For tsallis; 1 is Shannon's entropy.",
            minimum=-100,
            maximum=100,
            advanced=True,
        ),
    ] = 2.0,
    bins: Annotated[
        int | None,
        Number(
            label="Histogram bins",
            help="Number of grey levels of the joint histogram; by default 8 to 32, by the size "
            "of the window.",
            integer=True,
            minimum=2,
            maximum=256,
            advanced=True,
        ),
    ] = None,
    binning: Annotated[
        str,
        Choice(
            label="Binning",
            help="Whether grey levels hold equally many pixels, are equally wide, or are all "
            "grey values that there are (slow).",
            choices=(*BINNINGS, GREY_VALUES),
            advanced=True,
        ),
    ] = "equal-frequency",
    gpve_order: GpveOrder = 4,
    sample: Annotated[
        int,
        Number(
            label="Sample",
            help="For mlmi: number of pixels of the window that are used.",
            integer=True,
            minimum=50,
            maximum=20_000,
            advanced=True,
        ),
    ] = 1000,
    reference_band: ReferenceBand = None,
    input_band: InputBand = None,
    reference_mask: ReferenceMask = None,
    input_mask: InputMask = None,
    matching_pixel_size: MatchingPixelSize = None,
    workers: Workers = None,
    seed: Seed = 0,
    progress: Progress = SILENT,
) -> SurfaceResult:
    """Show what a measure of similarity says of every shift of one window.

    A window of the reference is compared with the input at all shifts around the place where the
    input claims to show it. The result is a raster: the pixel of a shift lies where the window's
    centre lies when it is so shifted, so that the peak lies where the input shows what the
    reference shows at the centre.

    The surface has one peak that stands out if the measure is fit for the images. Nothing is
    registered and nothing judged.
    """
    settings = SurfaceSettings(similarity, bins, binning, gpve_order, alpha, q, sample, seed)
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())

        def opened(path: Path | None) -> RasterSource | None:
            return None if path is None else stack.enter_context(open_raster(path))

        pair = make_pair(
            Image(
                stack.enter_context(open_raster(reference)), reference_band, opened(reference_mask)
            ),
            Image(stack.enter_context(open_raster(input)), input_band, opened(input_mask)),
            matching_pixel_size,
            search_radius_m=0.0,
        )
        for note in pair.notes():
            progress.update(0.0, note)
        window = Window(
            pair, _centre(pair, centre_x, centre_y), chip_size | 1, _radius(pair, search_radius)
        )
        patches = window.read()
        progress.update(0.1, "measuring similarity")
        executor = stack.enter_context(ThreadPoolExecutor(worker_count(workers)))
        values, evidence = settings.surfaces(*patches, window, executor, progress.part(0.1, 0.9))
    peak = find_peak(evidence)
    files = {"output": output, "picture": picture, "numbers": numbers}
    result = SurfaceResult(
        similarity,
        values,
        evidence,
        window.grid(window.radius_px),
        peak,
        second_peak(evidence, peak),
        window.chip_px,
        {name: str(path) for name, path in files.items() if path is not None},
    )
    progress.update(0.9, "writing")
    with Outputs() as outputs:
        write_surface(outputs.stage(output), result)
        if picture is not None:
            draw_surface(outputs.stage(picture), result)
        if numbers is not None:
            staged = outputs.stage(numbers)
            with writing(staged):
                staged.write_text(json.dumps(result.summary(), indent=1), encoding="utf-8")
    return result


def _centre(pair: ImagePair, x: float | None, y: float | None) -> tuple[int, int]:
    """Return column and row of the matching pixel at the window's centre."""
    if (x is None) != (y is None):
        raise ParameterError("give both x and y of the centre, or none")
    px = np.array(pair.grid.centre_px)
    if x is not None and y is not None:
        px = pair.grid.map_to_pixel([[x, y]])[0]
        if not pair.grid.contains(px):
            raise NoOverlapError(f"the centre {x:.15g}, {y:.15g} does not lie in the overlap")
    col, row = np.floor(px + 0.5).astype(int)
    return int(col), int(row)


def _radius(pair: ImagePair, radius_m: float | None) -> int:
    if radius_m is None:
        return _DEFAULT_RADIUS_PX
    radius = round(radius_m / pair.grid.pixel_size_m)
    if not 2 <= radius <= _LARGEST_RADIUS_PX:
        low, high = (n * pair.grid.pixel_size_m for n in (2, _LARGEST_RADIUS_PX))
        raise ParameterError(
            f"the search radius must be {low:.6g} to {high:.6g} m, 2 to {_LARGEST_RADIUS_PX} "
            f"pixels of the matching grid, not {radius_m:.6g} m"
        )
    return radius


def write_surface(path: Path, result: SurfaceResult) -> None:
    """Write a surface as a GeoTIFF: the values of the measure, and the evidence."""
    bands: NDArray[np.float32] = np.stack([result.values, result.evidence])
    with writing(path):
        with rasterio.open(
            path,
            "w",
            driver="GTiff",
            count=len(bands),
            height=result.grid.height,
            width=result.grid.width,
            dtype="float32",
            nodata=float("nan"),
            crs=result.grid.crs,
            transform=result.grid.transform,
            tiled=True,
            blockxsize=BLOCK,
            blockysize=BLOCK,
            compress="deflate",
        ) as dataset:
            dataset.write(bands)
            dataset.set_band_description(1, result.similarity)
            dataset.set_band_description(2, "robust standard deviations")
        check_complete(path)


def draw_surface(path: Path, result: SurfaceResult) -> None:
    """Draw a surface with its peaks as a PNG."""
    from matplotlib.figure import Figure

    edge = result.grid.width / 2
    figure = Figure(figsize=(6.4, 5.2), layout="constrained")
    axes = figure.add_subplot()
    shown = axes.imshow(result.values, extent=(-edge, edge, edge, -edge), cmap="viridis")
    figure.colorbar(shown, label=result.similarity)
    axes.plot(*result.peak.shift_px, "o", mfc="none", mec="red", ms=14, mew=1.8, label="peak")
    if result.second is not None:
        axes.plot(*result.second.shift_px, "s", mfc="none", mec="white", ms=10, label="second peak")
    # Rows run downwards, as on the map.
    axes.set(xlabel="to the right (px)", ylabel="downwards (px)")
    axes.legend(loc="upper right", framealpha=0.7)
    right, down = result.peak.shift_px
    axes.set_title(f"peak at {right:+.2f}, {down:+.2f} px, height {result.peak.height:.1f}")
    with writing(path):
        figure.savefig(path, format="png", dpi=150, metadata={"Software": None})
