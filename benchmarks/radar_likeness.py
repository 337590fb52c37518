"""Similarity of simulated and real radar images in the statistics that matching depends on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from groundtie.arrays import Raster
from groundtie.masks.scene import Scene
from groundtie.masks.town import share_of_strong_scatterers
from groundtie.rasters.reading import Window, open_raster
from groundtie.simulation.sar import SarOptions, render_sar
from groundtie.simulation.scene import SceneOptions, generate_scenes
from groundtie.speckle.statistics import estimate_looks, local_statistics

from .cases import SAR_SAR, read_cases
from .suites import Settings, SuiteResult, Table, by_group

SIZE_PX = 600
_MARGIN_PX = 192

# Texture window, largest lag of the autocorrelation, block side, and the step between block means
# that counts as an edge; single-look speckle has 1.4 dB there.
_WINDOW_PX, _LAGS_PX, _BLOCK_PX, _EDGE_DB = 9, 64, 4, 5.0

_Image = NDArray[np.float32]

# Radar images of SAR–optical pairs by group, except those in decibels or rescaled. The SAR–SAR
# pairs show open country.
_TOWNS = {
    "so-rosenheim": "SAR2_sen.tif",
    "so-dense-urban": "SAR_sen.png",
    "so-interchange": "pair10-2.jpg",
    "so-airport": "t1.tif",
}
_COUNTRY = {"so-fields": "SAR1_sen.tif", "so-delta": "SO1a.png", "so-forest-river": "SO3a.png"}

# Central share of each side of a real image that is used: some have empty corners.
_MIDDLE = 0.7

SIMULATED: Mapping[str, tuple[float, float]] = {
    # Pixel size and looks, roughly those of the real images.
    "rural": (3.0, 2.0),
    "suburban": (3.0, 2.0),
    "urban": (3.0, 2.0),
    "city": (3.0, 2.0),
    "city, 1 m, 1 look": (1.0, 1.0),
}


@dataclass(frozen=True)
class Likeness:
    """Statistics of one radar image.

    Parameters
    ----------
    name, group
        The image, and the group it is counted in.
    looks
        Equivalent number of looks in homogeneous areas.
    span_db, tail_db
        Range of the power from the 10 % to the 90 % quantile, and from the median to the 99 % one.
    strong
        Share of strong scatterers, 0 to 1: blocks 6 dB above the median.
    texture
        Median coefficient of variation in windows, relative to that of speckle.
    near, far
        Autocorrelation of the logarithm at 1 px, and the lag at which it falls below a tenth, at
        most `_LAGS_PX`.
    edges
        Share of block borders, 0 to 1, with a step of `_EDGE_DB` or more.
    """

    name: str
    group: str
    looks: float
    span_db: float
    tail_db: float
    strong: float
    texture: float
    near: float
    far: float
    edges: float


def likeness(name: str, group: str, amplitude: _Image) -> Likeness:
    """Return the statistics of a radar image: valid amplitudes of shape (h, w)."""
    power = np.maximum(amplitude, np.float32(0.5)) ** 2
    valid = np.ones(power.shape, bool)
    looks = estimate_looks(power, valid)
    decibels = 10 * np.log10(power)
    low, middle, high, tail = np.percentile(decibels, [10, 50, 90, 99])
    variation = np.sqrt(local_statistics(power, valid, _WINDOW_PX).variation2)
    near, far = autocorrelation(decibels)
    return Likeness(
        name,
        group,
        looks,
        float(high - low),
        float(tail - middle),
        strong_share(amplitude),
        float(np.median(variation) * np.sqrt(looks)),
        near,
        far,
        edge_share(power),
    )


def autocorrelation(values: _Image) -> tuple[float, float]:
    """Return the autocorrelation at 1 px, and the lag where it falls below 0.1, means of both axes.

    The local mean is not removed: large structure is part of the measurement.
    """
    centred = values - values.mean()
    size = [scipy.fft.next_fast_len(n + _LAGS_PX, real=True) for n in centred.shape]
    found = scipy.fft.irfft2(np.abs(scipy.fft.rfft2(centred, size)) ** 2, size)
    lags = np.arange(_LAGS_PX + 1)
    height, width = centred.shape
    # Normalised by the number of pixel pairs at each lag.
    along = found[0, : _LAGS_PX + 1] / (width - lags) * width
    down = found[: _LAGS_PX + 1, 0] / (height - lags) * height
    curve = (along + down) / 2 / found[0, 0]
    below = np.flatnonzero(curve < 0.1)
    return float(curve[1]), float(below[0] if len(below) else _LAGS_PX)


def strong_share(amplitude: _Image) -> float:
    """Return the share of strong scatterers, counted as for every pair."""
    with open_raster(Raster(amplitude)) as made:
        return share_of_strong_scatterers(Scene.of(made))


def edge_share(power: _Image) -> float:
    """Return the share of neighbouring blocks whose mean power differs by an edge or more."""
    height, width = (n // _BLOCK_PX for n in power.shape)
    inside = power[: height * _BLOCK_PX, : width * _BLOCK_PX]
    blocks = cv2.resize(inside, (width, height), interpolation=cv2.INTER_AREA)
    level = 10 * np.log10(blocks)
    steps = [np.abs(np.diff(level, axis=axis)).ravel() for axis in (0, 1)]
    return float(np.mean(np.concatenate(steps) >= _EDGE_DB))


def real_images(data: Path) -> Iterator[Likeness]:
    """Yield the statistics of the radar images of the real pairs."""
    for group, named in (("real, towns", _TOWNS), ("real, country", _COUNTRY)):
        for case, file in named.items():
            yield likeness(case, group, _middle_of(data / case / file))
    for pair in read_cases(data):
        if pair.kind == SAR_SAR:
            for path in (pair.reference, pair.input):
                yield likeness(f"{pair.name}/{path.stem}", "real, country", _middle_of(path))


def _middle_of(path: Path) -> _Image:
    with open_raster(path) as source:
        width, height = source.grid.width, source.grid.height
        inside = [round(side * _MIDDLE) for side in (width, height)]
        first = [(side - within) // 2 for side, within in zip((width, height), inside, strict=True)]
        return source.read(Window(*first, *inside))[0]


def simulated_images(seeds: Iterable[int]) -> Iterator[Likeness]:
    """Yield the statistics of simulated radar images."""
    for kind, (pixel_m, looks) in SIMULATED.items():
        for seed in seeds:
            options = SceneOptions((SIZE_PX, SIZE_PX), pixel_m, kind.split(",")[0], seed=seed)
            image = render_sar(
                generate_scenes(options, _MARGIN_PX).radar, SarOptions(40.0, looks=looks)
            )
            amplitude = image.astype(np.float32)
            yield likeness(f"seed {seed}", f"simulated, {kind}", amplitude)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    found = [*real_images(settings.data), *simulated_images(settings.seed_numbers(3))]
    return SuiteResult(
        "How simulated radar images are like real ones",
        (),
        (likeness_table(found), image_table(found)),
        [asdict(one) for one in found],
        (
            "Medians of the images of a group, in brackets the least and the largest. Looks from "
            "homogeneous areas; power from the 10 % to the 90 % quantile, and from the median to "
            "the 99 % one; blocks 6 dB above the median; median coefficient of variation in "
            f"{_WINDOW_PX} × {_WINDOW_PX} px over the speckle's; autocorrelation of decibels; "
            f"borders between blocks of {_BLOCK_PX} × {_BLOCK_PX} px with {_EDGE_DB:g} dB or more. "
            "The real images have 8 bits, with bright scatterers cut off, and pixels of 1 to 10 m.",
        ),
    )


_COLUMNS: tuple[tuple[str, Callable[[Likeness], float], str], ...] = (
    ("looks", lambda one: one.looks, "{:.1f}"),
    ("10–90 % (dB)", lambda one: one.span_db, "{:.0f}"),
    ("50–99 % (dB)", lambda one: one.tail_db, "{:.0f}"),
    ("strong scatterers", lambda one: one.strong, "{:.0%}"),
    ("texture", lambda one: one.texture, "{:.1f}"),
    ("correlation at 1 px", lambda one: one.near, "{:.2f}"),
    ("below 0.1 at (px)", lambda one: one.far, "{:.0f}"),
    ("edges", lambda one: one.edges, "{:.0%}"),
)


def likeness_table(found: Iterable[Likeness]) -> Table:
    """Return a table with a row for each group of images."""
    rows = []
    for name, group in by_group(found).items():
        cells = []
        for _, of, form in _COLUMNS:
            values = np.array([of(one) for one in group])
            spread = np.median(values), values.min(), values.max()
            middle, low, high = (form.format(value) for value in spread)
            cells.append(f"{middle} ({low}–{high})")
        rows.append([name, str(len(group)), *cells])
    return Table("By group", ("", "images", *(column for column, _, _ in _COLUMNS)), rows)


def image_table(found: Iterable[Likeness]) -> Table:
    """Return a table with a row for each image."""
    rows = [
        [one.group, one.name, *(form.format(value(one)) for _, value, form in _COLUMNS)]
        for one in found
    ]
    return Table("By image", ("", "image", *(column for column, _, _ in _COLUMNS)), rows)
