"""Gradients of an image at given scales and at those of its keypoints, for descriptors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import distance_to_masked
from ..rasters.reading import FloatImage
from ..similarity.orientation import ROUNDING
from .keypoints import Keypoints

# Derivatives along columns and rows, shape (h, w) each, and their estimator.
Gradient = tuple[FloatImage, FloatImage]
GradientOperator = Callable[[FloatImage], Gradient]

# Scale space: layers per octave, the first scale, and the blur of an original image, as in
# [Lowe2004] and OpenCV.
LAYERS = 3
FIRST_SCALE_PX = 1.6
IMAGE_BLUR_PX = 0.5

# Reach of a gradient in scales, except for the Gaussian's tail.
_SEES_SCALES = 2.5

# Number of keypoints that are described at a time.
_BLOCK = 512


def differences(image: FloatImage) -> Gradient:
    """Return differences between the next and the previous pixel ([Suri2010] eq 6.5, 6.6)."""
    padded = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_REFLECT_101)
    along_cols = padded[1:-1, 2:] - padded[1:-1, :-2]
    along_rows = padded[2:, 1:-1] - padded[:-2, 1:-1]
    return np.asarray(along_cols, np.float32), np.asarray(along_rows, np.float32)


def gradients_at_scales(
    image: FloatImage,
    valid: NDArray[np.bool_],
    found: Keypoints,
    gradient: GradientOperator = differences,
) -> Iterator[tuple[NDArray[np.intp], Keypoints, Gradient]]:
    """Yield blocks of keypoints: row numbers, the points in a gradient's pixels, and that gradient.

    The gradient is at the scale of the block's keypoints.

    Parameters
    ----------
    image, valid
        Grey values and their validity, shape (h, w).
    found
        Keypoints, shape (n,).
    gradient
        Estimator of an image's gradient.
    """
    layer_of = _layer_of(found.scale_px)
    layers = [int(layer) for layer in np.unique(layer_of)]
    distance = distance_to_masked(valid)
    for layer, level in zip(layers, _scale_space(image, layers), strict=True):
        pixel = 2 ** _octave_of(layer)
        seen = distance[::pixel, ::pixel] > _SEES_SCALES * _scale_of(layer)
        fields = _gradient(level, seen, gradient)
        own = np.nonzero(layer_of == layer)[0]
        for start in range(0, len(own), _BLOCK):
            block = own[start : start + _BLOCK]
            points = found.take(block)
            position_px, scale_px = points.position_px / pixel, points.scale_px / pixel
            yield block, replace(points, position_px=position_px, scale_px=scale_px), fields


def gradient_at_scale(image: FloatImage, valid: NDArray[np.bool_], scale_px: float) -> Gradient:
    """Return the gradient at the layer of scale space that is nearest to a scale.

    Parameters
    ----------
    image, valid
        Grey values and their validity, shape (h, w).
    scale_px
        The scale, below twice that of the first octave, whose pixels are the image's.

    Returns
    -------
    Two arrays of shape (h, w), zero within reach of masked pixels.
    """
    layer = _layer_of(scale_px)
    (level,) = _scale_space(image, [layer])
    return _gradient(
        level, distance_to_masked(valid) > _SEES_SCALES * _scale_of(layer), differences
    )


def _layer_of(scale_px: Any) -> Any:
    return np.rint(LAYERS * np.log2(scale_px / FIRST_SCALE_PX)).astype(int)


def _scale_space(image: FloatImage, layers: Iterable[int]) -> Iterator[FloatImage]:
    """Yield an image blurred to the scales of ascending layers, in the pixels of their octaves."""
    own = _blurred(image, IMAGE_BLUR_PX, FIRST_SCALE_PX)
    octave = 0
    for layer in layers:
        while octave < _octave_of(layer):
            # The first pixels of all octaves coincide.
            own = _blurred(own, FIRST_SCALE_PX, 2 * FIRST_SCALE_PX)[::2, ::2]
            octave += 1
        if layer <= 0:
            yield _blurred(image, IMAGE_BLUR_PX, _scale_of(layer))
        else:
            yield _blurred(own, FIRST_SCALE_PX, _scale_of(layer) / 2**octave)


def _octave_of(layer: int) -> int:
    """Return the octave whose pixels a layer has; layers of the enlarged image have those of 0."""
    return max((layer - 1) // LAYERS, 0)


def _scale_of(layer: int) -> float:
    return float(FIRST_SCALE_PX * 2 ** (layer / LAYERS))


def _blurred(image: FloatImage, blur_px: float, wanted_px: float) -> FloatImage:
    """Blur an image further, from a total blur of `blur_px` to one of `wanted_px`."""
    more = float(np.sqrt(max(wanted_px**2 - blur_px**2, 0.01)))
    return np.asarray(cv2.GaussianBlur(np.ascontiguousarray(image), (0, 0), more), np.float32)


def _gradient(level: FloatImage, seen: NDArray[np.bool_], gradient: GradientOperator) -> Gradient:
    """Return the gradient of a level, zero within reach of masked pixels and below rounding."""
    along_cols, along_rows = gradient(level)
    least = np.float32(ROUNDING * np.abs(level).max())
    counts = seen & (along_cols**2 + along_rows**2 > least**2)
    zero = np.float32(0)
    return np.where(counts, along_cols, zero), np.where(counts, along_rows, zero)
