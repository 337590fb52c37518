"""The determinant of the Hessian by box filters on the integral image ([Bay2008]).

Second derivatives of a Gaussian are approximated by a few boxes; a box of any size costs four
values of the integral image. Boxes of a filter share sums over rows, and the work is done on strips
of rows that stay in the processor's cache.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..rasters.reading import FloatImage

IntegralImage = NDArray[np.float64]

# Side of the smallest filter, and standard deviation of the Gaussian that it approximates.
FIRST_SIDE_PX, FIRST_SIGMA_PX = 9, 1.2

# Correction of the mixed derivative, which boxes overestimate ([Bay2008], eq 3).
_MIXED_WEIGHT = np.float32(0.9)

# Pixels of a strip: a few arrays of this size fit into the second-level cache.
_STRIP_PX = 64_000


def integral_image(image: FloatImage) -> IntegralImage:
    """Return the sums of all pixels above and left of each position, shape (h + 1, w + 1).

    The mean is subtracted first, so that sums stay small.
    """
    centred = image - np.float32(image.mean())
    return np.asarray(cv2.integral(centred, sdepth=cv2.CV_64F))


def sigma_of(side_px: Any) -> Any:
    """Return the standard deviation of the Gaussian that a filter approximates, in pixels."""
    return side_px * FIRST_SIGMA_PX / FIRST_SIDE_PX


def determinants(
    integral: IntegralImage,
    sides_px: tuple[int, ...],
    step: int = 1,
    context: Context | None = None,
) -> list[FloatImage]:
    """Return the determinant of the Hessian for several filters.

    Parameters
    ----------
    integral
        From `integral_image`, shape (h + 1, w + 1).
    sides_px
        Sides of the filters: odd multiples of 3.
    step
        Spacing of the computed columns and rows, starting at the first.
    context
        Provides threads; None: the current one only.

    Returns
    -------
    One image per filter, shape (⌈h / step⌉, ⌈w / step⌉), in grey values squared over pixels⁴ times
    the filter's scale⁴, up to a constant; 0 where the filter extends beyond the image.
    """
    height, width = (size - 1 for size in integral.shape)
    shape = -(-height // step), -(-width // step)
    found = [np.zeros(shape, np.float32) for _ in sides_px]
    rows = max(_STRIP_PX // width, 1)
    tasks = []
    for side, out in zip(sides_px, found, strict=True):
        margin = -(-(side // 2) // step)
        last = (height - 1 - side // 2) // step
        for first in range(margin, last + 1, rows):
            strip = slice(first, min(first + rows, last + 1))
            tasks.append(partial(_fill, integral, side, step, strip, out))
    for _ in map(_call, tasks) if context is None else context.map(_call, tasks):
        pass
    return found


def _call(task: partial[None]) -> None:
    task()


def _fill(integral: IntegralImage, side: int, step: int, strip: slice, out: FloatImage) -> None:
    """Compute the rows `strip` of `out`, except columns where the filter leaves the image."""
    lobe, half = side // 3, side // 2
    middle = lobe // 2
    width = integral.shape[1] - 1
    first_col = -(-half // step)
    last_col = (width - 1 - half) // step
    if last_col < first_col:
        return

    def row(offset: int) -> IntegralImage:
        return integral[strip.start * step + offset : (strip.stop - 1) * step + offset + 1 : step]

    def rows(top: int, bottom: int) -> FloatImage:
        """Return sums over rows `top` to `bottom`, inclusive, and all columns to the left."""
        # The sums up to here need double precision; their differences fit into single.
        return np.subtract(row(bottom + 1), row(top)).astype(np.float32)

    def cols(sums: FloatImage, left: int, right: int) -> FloatImage:
        start, stop = first_col * step, last_col * step + 1
        after = sums[:, start + right + 1 : stop + right + 1 : step]
        return np.asarray(after - sums[:, start + left : stop + left : step])

    three = np.float32(3)
    long = rows(1 - lobe, lobe - 1)
    along_cols = cols(long, -half, half) - three * cols(long, -middle, middle)
    bands = rows(-half, half) - three * rows(-middle, middle)
    along_rows = cols(bands, 1 - lobe, lobe - 1)
    above_below = rows(-lobe, -1) - rows(1, lobe)
    mixed = cols(above_below, -lobe, -1) - cols(above_below, 1, lobe)
    mixed *= _MIXED_WEIGHT
    along_cols *= along_rows
    mixed *= mixed
    along_cols -= mixed
    along_cols *= np.float32(side**-4)
    out[strip, first_col : last_col + 1] = along_cols
