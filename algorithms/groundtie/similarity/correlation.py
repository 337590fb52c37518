"""Correlation of a template with a search window over all shifts, by FFT, with masks."""

from __future__ import annotations

import functools
import math
from typing import Any

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from .stacks import each

_ZERO = cv2.BORDER_CONSTANT

# Shifts at which a smaller share of the template's pixels overlaps are not compared.
MINIMUM_OVERLAP = 0.3

# Variances count if rounding is at most this share of them: half the digits of single precision.
_ROUNDING = math.sqrt(np.finfo(np.float32).eps)


def correlate(
    template: NDArray[Any], search: NDArray[Any], workers: int = 1
) -> NDArray[np.float32]:
    """Return Σ Re(conj(template) · search) at all shifts at which the template lies inside.

    Parameters
    ----------
    template, search
        Real or complex arrays, shapes (…, h, w) and (…, h + ny - 1, w + nx - 1).
    workers
        Number of threads.

    Returns
    -------
    Array of shape (…, ny, nx), float32.
    """
    shape, (rows, cols) = fast_shape(search), spans(template, search)
    product = spectrum(template, shape, workers).conj() * spectrum(search, shape, workers)
    found = from_spectrum(product, shape, (rows, cols), workers)
    return np.asarray(found.real, np.float32)


def fast_shape(search: NDArray[Any]) -> tuple[int, int]:
    """Return a shape that is quick to transform and not smaller than a search window."""
    rows, cols = (scipy.fft.next_fast_len(n) for n in search.shape[-2:])
    return rows, cols


def tight_shape(template: NDArray[Any], filled: NDArray[np.bool_]) -> tuple[int, int]:
    """Return a quicker shape still, in which empty ends of a search window wrap onto each other.

    For whole numbers only: sums of other values change their last digits with the shape.

    Parameters
    ----------
    template
        As in `correlate`.
    filled
        Pixels of the search window that are not 0.
    """
    rows, cols = (_fast_length(filled.shape[k] - _empty(template, filled, k)) for k in (-2, -1))
    return rows, cols


@functools.cache
def _fast_length(least: int) -> int:
    """Return a length that is quick to transform; multiples of 11 take a third longer."""
    length = scipy.fft.next_fast_len(least)
    return length if length % 11 else _fast_length(length + 1)


def _empty(template: NDArray[Any], filled: NDArray[np.bool_], axis: int) -> int:
    """Return how many lines are empty at both ends of a search window and can be left out."""
    size, own = filled.shape[axis], template.shape[axis]
    if filled.take([0, -1], axis).any():
        return 0
    others = tuple(k for k in range(-filled.ndim, 0) if k != axis)
    lines = np.flatnonzero(filled.any(axis=others))
    ends = (lines[0], size - 1 - lines[-1]) if lines.size else (size, size)
    # The shape must still hold the template and all shifts.
    return int(min(*ends, size - own, own - 1))


def spans(template: NDArray[Any], search: NDArray[Any]) -> tuple[int, int]:
    """Return the numbers of shifts along rows and columns that keep a template inside a window."""
    (own_rows, own_cols), (rows, cols) = template.shape[-2:], search.shape[-2:]
    return rows - own_rows + 1, cols - own_cols + 1


def spectrum(images: NDArray[Any], shape: tuple[int, int], workers: int = 1) -> NDArray[Any]:
    """Return spectra of images, (…, h, w), zero-padded to a shape; half spectra of real images."""
    # Rows of padding are not transformed.
    transform = scipy.fft.fft if np.iscomplexobj(images) else scipy.fft.rfft
    along_rows = transform(images, shape[1], workers=workers)
    return scipy.fft.fft(along_rows, shape[0], axis=-2, overwrite_x=True, workers=workers)


def from_spectrum(
    spectra: NDArray[Any], shape: tuple[int, int], spans: tuple[int, int], workers: int = 1
) -> NDArray[Any]:
    """Return the upper left parts, (…, ny, nx), of the images of a shape, from their spectra.

    Images of half spectra are real. Spectra may be overwritten.
    """
    # Rows that are not returned are not transformed.
    lines = scipy.fft.ifft(spectra, axis=-2, norm="forward", overwrite_x=True, workers=workers)[
        ..., : spans[0], :
    ]
    is_half = spectra.shape[-1] != shape[1]
    inverse = scipy.fft.irfft if is_half else scipy.fft.ifft
    found = inverse(lines, shape[1], norm="forward", workers=workers)[..., : spans[1]]
    return found * found.dtype.type(1 / math.prod(shape))


def box_sums(images: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """Return the sums of images, (…, h, w), over all boxes of a size: (…, h - height + 1, …)."""
    rows, cols = images.shape[-2:]
    # Images are stacked one above the other: boxes inside one do not reach the next.
    tall = images.reshape(-1, cols)
    sums = cv2.boxFilter(
        tall, cv2.CV_32F, (width, height), anchor=(0, 0), normalize=False, borderType=_ZERO
    )
    inside = sums.reshape(images.shape)[..., : rows - height + 1, : cols - width + 1]
    return np.asarray(inside, np.float32)


def overlap_share(template: Patch, search: Patch) -> NDArray[np.float32]:
    """Return the share of the template's valid pixels that meets valid ones at each shift.

    Shape (…, ny, nx) for stacks of windows, (…, h, w).
    """
    count = np.maximum(template.valid.sum(axis=(-2, -1), keepdims=True, dtype=np.float32), 1)
    return _sums_where(template.valid, search.valid.astype(np.float32)) / count


def _sums_where(valid: NDArray[np.bool_], images: FloatImage, workers: int = 1) -> FloatImage:
    """Return the sums of images over the valid pixels of a template, at all of its shifts."""
    whole = valid.all(axis=(-2, -1), keepdims=True)
    sums = box_sums(images, *valid.shape[-2:])
    if whole.all():
        return sums
    return np.where(whole, sums, correlate(valid.astype(np.float32), images, workers))


def correlate_fields(
    template: NDArray[np.complex64],
    search: NDArray[np.complex64],
    template_valid: NDArray[np.bool_],
    search_valid: NDArray[np.bool_],
    workers: int = 1,
) -> NDArray[np.float32]:
    """Return the correlation coefficients of complex fields over shifts, -1 to 1.

    Parameters
    ----------
    template, search
        Fields that are zero where they are not valid, shapes (n, …, h, w) and
        (n, …, h + ny - 1, w + nx - 1). Each shift is normalised by the energy of the overlap.
    template_valid, search_valid
        Validity of pixels, shapes (…, h, w) and (…, h + ny - 1, w + nx - 1).
    workers
        Number of threads.

    Returns
    -------
    Array of shape (n, …, ny, nx), float32.
    """
    template_energy = template.real**2 + template.imag**2
    search_energy = search.real**2 + search.imag**2
    own_energy = template_energy.sum(axis=(-2, -1), keepdims=True)
    whole = search_valid.all(axis=(-2, -1), keepdims=True)
    if not whole.all():
        seen = correlate(template_energy, search_valid.astype(np.float32), workers)
        own_energy = np.where(whole, own_energy, seen)
    energy = _sums_where(template_valid, search_energy, workers) * own_energy
    highest = energy.max(axis=(-2, -1), keepdims=True, initial=0)
    floor = np.float32(1e-6) * np.maximum(highest, np.float32(1e-12))
    found = correlate(template, search, workers) / np.sqrt(np.maximum(energy, floor))
    return np.where(energy > floor, found, 0).astype(np.float32)


def correlate_grey(template: Patch, search: Patch) -> NDArray[np.float32]:
    """Return the normalised cross-correlation of grey values over shifts ([Suri2010] eq 3.2).

    With masks, each shift is normalised over the pixels that are valid in both [Padfield2012].

    Parameters
    ----------
    template, search
        Windows of shapes (…, h, w) and (…, h + ny - 1, w + nx - 1).

    Returns
    -------
    Array of shape (…, ny, nx), float32.
    """
    t, s = _centred(template), _centred(search)
    whole = template.valid.all(axis=(-2, -1)) & search.valid.all(axis=(-2, -1))
    found = np.empty((*whole.shape, *spans(t, s)), np.float32)
    # Each image is worked alone, so that its digits do not depend on the stack.
    if whole.any():
        found[whole] = each(_coefficients, t[whole], s[whole])
    if not whole.all():
        part = t[~whole], template.valid[~whole], s[~whole], search.valid[~whole]
        found[~whole] = _masked_coefficients(*part)
    return found


def _coefficients(t: FloatImage, s: FloatImage) -> FloatImage:
    return np.asarray(cv2.matchTemplate(s, t, cv2.TM_CCOEFF_NORMED), np.float32)


def _centred(patch: Patch) -> FloatImage:
    """Return images without the means of their valid pixels, 0 where they are not valid.

    Single precision would lose small contrast on large values. Images are scaled to 1, so that it
    holds their squares in any unit; the factor is a power of two, which changes no digit.
    """
    counts = patch.valid.astype(np.float32)
    sums = (patch.values * counts).sum(axis=(-2, -1), keepdims=True)
    means = sums / np.maximum(counts.sum(axis=(-2, -1), keepdims=True), 1)
    centred = patch.values - means
    centred *= counts
    low, high = (of(centred, axis=(-2, -1), keepdims=True) for of in (np.min, np.max))
    _, exponents = np.frexp(np.maximum(-low, high))
    scale = np.ldexp(np.float32(1), np.minimum(-exponents, 127))
    # A constant image leaves only rounding.
    centred *= np.where(low < high, scale, np.float32(0))
    return np.asarray(centred)


def _masked_coefficients(
    t: FloatImage, t_valid: NDArray[np.bool_], s: FloatImage, s_valid: NDArray[np.bool_]
) -> FloatImage:
    """Return the correlation over pixels valid in both images, which are 0 where not valid."""
    found, is_exact = _coefficients_where_valid(t, t_valid, s, s_valid, np.float32)
    if not is_exact.all():
        # Strong scatterers exceed single precision; double takes more than twice the time.
        rough = ~is_exact
        part = t[rough], t_valid[rough], s[rough], s_valid[rough]
        found[rough] = _coefficients_where_valid(*part, np.float64)[0]
    return found


def _coefficients_where_valid(
    t: FloatImage,
    t_valid: NDArray[np.bool_],
    s: FloatImage,
    s_valid: NDArray[np.bool_],
    precision: type[np.floating],
) -> tuple[FloatImage, NDArray[np.bool_]]:
    """Return coefficients, (n, ny, nx), and for which images they are exact at all shifts, (n,).

    Coefficients are 0 where the precision does not resolve the variances.
    """
    # Each of a window's three spectra is used in several sums.
    shape = fast_shape(s)
    of_t, of_s = (
        spectrum(
            np.stack([valid.astype(precision), image, np.square(image, dtype=precision)]), shape
        )
        for image, valid in ((t, t_valid), (s, s_valid))
    )
    np.conj(of_t, out=of_t)

    def sums(own: int, other: int) -> NDArray[Any]:
        return from_spectrum(of_t[own] * of_s[other], shape, spans(t, s))

    count, sum_t, sum_s = np.maximum(sums(0, 0), 1), sums(1, 0), sums(0, 1)
    covariance = sums(1, 1) - sum_t * sum_s / count
    variance_t, variance_s = sums(2, 0) - sum_t**2 / count, sums(0, 2) - sum_s**2 / count
    # Sums from spectra are rounded by a last digit of the product of both norms. The norm of a
    # mask is the root of its sum, the spectrum at frequency 0; for squares up to 1, that root is
    # an upper limit.
    valid_t, _, squares_t = of_t[..., :1, :1].real
    valid_s, _, squares_s = of_s[..., :1, :1].real
    unit = np.finfo(precision).eps / _ROUNDING
    known = (variance_t > unit * np.sqrt(squares_t * valid_s)) & (
        variance_s > unit * np.sqrt(valid_t * squares_s)
    )
    product = np.where(known, variance_t * variance_s, 1)
    found = np.where(known, covariance / np.sqrt(product), 0)
    compared = count >= MINIMUM_OVERLAP * valid_t
    return np.asarray(found, np.float32), np.asarray((known | ~compared).all(axis=(-2, -1)))
