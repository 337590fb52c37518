"""Statistics of speckled intensity: local mean and variation, equivalent number of looks."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..rasters.patch import window_sums
from ..rasters.reading import FloatImage, Mask

# Squared mean power below which a window counts as empty: running sums leave such residues.
_NO_POWER = np.float32(1e-30)

# Window in which looks are estimated, and the histogram's bins, in octaves of the squared
# coefficient of variation. Homogeneous areas form its first peak, at least _PEAK times as high as
# the highest. Windows that vary less are of graphics or frames without sensor noise. No image has
# less than one look.
LOOKS_WINDOW_PX = 9
_BIN_OCTAVES = 0.125
_OCTAVES = (-14.0, 0.375)
_PEAK = 0.2

# Largest ratio, in such a window of a homogeneous area, of the squared coefficient of variation to
# that of speckle alone.
HOMOGENEOUS_EXCESS = 1.3

# Window, and share of the most homogeneous windows, that separate speckled images from others.
_HOMOGENEOUS_WINDOW_PX = 3
_HOMOGENEOUS_SHARE = 0.1

# Windows with a smaller share of valid pixels are left out of the looks' estimate.
_LEAST_VALID = 0.9


@dataclass(frozen=True)
class LocalStatistics:
    """Mean and squared coefficient of variation around each pixel, float32 of shape (h, w)."""

    mean: FloatImage
    variation2: FloatImage


def local_statistics(intensity: FloatImage, valid: Mask, window_px: int) -> LocalStatistics:
    """Return the statistics of the valid pixels in a square window around each pixel.

    Parameters
    ----------
    intensity
        Power of the signal, shape (h, w); invalid pixels are 0.
    valid
        Which pixels count, shape (h, w). Pixels beyond the image do not.
    window_px
        Side of the window, odd.

    Returns
    -------
    LocalStatistics
        Both 0 where nothing in the window is valid.
    """
    size, outside = (window_px, window_px), cv2.BORDER_CONSTANT
    # In place where possible: masks are made for whole scenes.
    mean: FloatImage = window_sums(intensity, window_px)
    squares: FloatImage = np.asarray(
        cv2.sqrBoxFilter(intensity, cv2.CV_32F, size, normalize=False, borderType=outside),
        np.float32,
    )
    weight = window_counts(valid, window_px)
    np.maximum(weight, np.float32(1), out=weight)
    np.divide(np.float32(1), weight, out=weight)
    mean *= weight
    squares *= weight
    power = np.multiply(mean, mean, out=weight)
    nothing = ~(power > _NO_POWER)
    variation2 = np.divide(squares, power, out=squares, where=~nothing)
    variation2[nothing] = 1
    variation2 -= 1
    return LocalStatistics(mean, np.maximum(variation2, np.float32(0), out=variation2))


def window_counts(valid: Mask, window_px: int) -> FloatImage:
    """Return the number of valid pixels in the window around each pixel, float32 (h, w)."""
    return window_sums(valid.astype(np.float32), window_px)


def estimate_looks(intensity: FloatImage, valid: Mask) -> float:
    """Return the equivalent number of looks of an image.

    In a homogeneous area, intensity has the squared coefficient of variation 1 / looks. Windows
    with edges or texture vary more, by different amounts: the first of the frequent values is that
    of homogeneous windows (after [Foucher2000]).

    Parameters
    ----------
    intensity
        Power of the signal, shape (h, w); invalid pixels are 0.
    valid
        Which pixels count, shape (h, w).

    Returns
    -------
    float
        At least 1; also 1 if no window is valid or none varies.
    """
    variation2 = local_statistics(intensity, valid, LOOKS_WINDOW_PX).variation2
    full = window_counts(valid, LOOKS_WINDOW_PX) >= _LEAST_VALID * LOOKS_WINDOW_PX**2
    inside = (variation2 > 2 ** _OCTAVES[0]) & (variation2 < 2 ** _OCTAVES[1])
    usual = variation2[full & inside]
    if usual.size == 0:
        return 1.0
    octave = np.log2(usual)
    bins = round((_OCTAVES[1] - _OCTAVES[0]) / _BIN_OCTAVES)
    counts, edges = np.histogram(octave, bins, _OCTAVES)
    counts = np.convolve(counts, np.ones(3), "same")
    # Texture and edges only add to the variation: the first of several peaks is that of speckle.
    rising = np.append(-1, counts)[:-1] < counts
    falling = np.append(counts, -1)[1:] <= counts
    peak = int(np.argmax(rising & falling & (counts >= _PEAK * counts.max())))
    low, high = edges[max(peak - 2, 0)], edges[min(peak + 3, bins)]
    return max(float(1 / np.median(usual[(octave >= low) & (octave < high)])), 1.0)


def homogeneous_variation2(intensity: FloatImage, valid: Mask) -> float:
    """Return the squared coefficient of variation in the most homogeneous tenth of all windows.

    Every window has speckle, while a camera's noise is far below its signal: the value of a radar
    image is larger than that of an optical one (measured: on all of 20 real pairs). Windows without
    any noise, as of frames, are left out.

    Parameters
    ----------
    intensity
        Power of the signal, shape (h, w); invalid pixels are 0.
    valid
        Which pixels count, shape (h, w).

    Returns
    -------
    float
        0 if no window is valid, or none has noise.
    """
    local = local_statistics(intensity, valid, _HOMOGENEOUS_WINDOW_PX)
    full = window_counts(valid, _HOMOGENEOUS_WINDOW_PX) == _HOMOGENEOUS_WINDOW_PX**2
    has_noise = local.variation2 > 2 ** _OCTAVES[0]
    variation2 = local.variation2[full & has_noise & (local.mean > 0)]
    return float(np.quantile(variation2, _HOMOGENEOUS_SHARE)) if variation2.size else 0.0
