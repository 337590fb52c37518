"""Correlation of a template with a search window over all shifts, by FFT, with masks."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..rasters.patch import Patch

# Overlaps of a smaller share of the template's pixels are not compared.
MINIMUM_OVERLAP = 0.3


def correlate(template: NDArray[Any], search: NDArray[Any]) -> NDArray[np.float32]:
    """Return Σ Re(conj(template) · search) at all shifts at which the template lies inside.

    Parameters
    ----------
    template, search
        Real or complex arrays, shapes (…, h, w) and (…, h + ny - 1, w + nx - 1).

    Returns
    -------
    Array of shape (…, ny, nx), float32.
    """
    size, spans = search.shape[-2:], _spans(template.shape[-2:], search.shape[-2:])
    if np.iscomplexobj(template):
        shape = _fast_shape(size)
        spectrum = scipy.fft.fft2(template, shape).conj() * scipy.fft.fft2(search, shape)
        return scipy.fft.ifft2(spectrum)[..., : spans[0], : spans[1]].real.astype(np.float32)
    of_template, of_search = _spectra(template, search, size)
    return _inverse(of_template.conj() * of_search, size, spans)


def _fast_shape(size: tuple[int, ...]) -> list[int]:
    return [scipy.fft.next_fast_len(n) for n in size]


def _spans(template: tuple[int, ...], search: tuple[int, ...]) -> tuple[int, int]:
    """Return at how many shifts of rows and columns a template lies inside a search window."""
    rows, cols = (s - t + 1 for s, t in zip(search, template, strict=True))
    return rows, cols


def _spectra(
    template: NDArray[Any], search: NDArray[Any], size: tuple[int, ...]
) -> tuple[NDArray[Any], NDArray[Any]]:
    shape = _fast_shape(size)
    return scipy.fft.rfft2(template, shape), scipy.fft.rfft2(search, shape)


def _inverse(
    spectrum: NDArray[Any], size: tuple[int, ...], spans: tuple[int, int]
) -> NDArray[np.float32]:
    found = scipy.fft.irfft2(spectrum, _fast_shape(size))
    return np.asarray(found[..., : spans[0], : spans[1]], np.float32)


def box_sums(image: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """Return the sums of an image over all boxes of a size, shape (h - height + 1, …)."""
    table = cv2.integral(image, sdepth=cv2.CV_64F)
    sums = table[height:, width:] - table[:-height, width:] - table[height:, :-width]
    return (sums + table[:-height, :-width]).astype(np.float32)


def overlap_share(template: Patch, search: Patch) -> NDArray[np.float32]:
    """Return at all shifts which share of the template's valid pixels meets valid pixels."""
    count = np.float32(max(int(template.valid.sum()), 1))
    if template.all_valid:
        return box_sums(search.valid.astype(np.float32), *template.valid.shape) / count
    overlap = correlate(template.valid.astype(np.float32), search.valid.astype(np.float32))
    return overlap / count


def correlate_fields(
    template: NDArray[np.complex64],
    search: NDArray[np.complex64],
    template_valid: NDArray[np.bool_],
    search_valid: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Return the correlation coefficients of complex fields over shifts, -1 to 1.

    Parameters
    ----------
    template, search
        Fields that are zero where they are not valid, shapes (n, h, w) and
        (n, h + ny - 1, w + nx - 1). Each shift is normalised by the energy of what overlaps.
    template_valid, search_valid
        What is valid, shapes (h, w) and (h + ny - 1, w + nx - 1).

    Returns
    -------
    Array of shape (n, ny, nx), float32.
    """
    template_energy = template.real**2 + template.imag**2
    search_energy = search.real**2 + search.imag**2
    if template_valid.all():
        energy = np.stack([box_sums(e, *template_valid.shape) for e in search_energy])
    else:
        energy = correlate(template_valid.astype(np.float32), search_energy)
    if search_valid.all():
        energy = energy * template_energy.sum(axis=(1, 2), keepdims=True)
    else:
        energy = energy * correlate(template_energy, search_valid.astype(np.float32))
    highest = energy.max(axis=(1, 2), keepdims=True, initial=0)
    floor = np.float32(1e-6) * np.maximum(highest, np.float32(1e-12))
    found = correlate(template, search) / np.sqrt(np.maximum(energy, floor))
    return np.where(energy > floor, found, 0).astype(np.float32)


def correlate_grey(template: Patch, search: Patch) -> NDArray[np.float32]:
    """Return the normalised cross-correlation of grey values over shifts ([Suri2010] eq 3.2).

    With masks, each shift is normalised by the pixels that are valid in both [Padfield2012].
    """
    mean = np.float32(search.values[search.valid].mean()) if search.valid.any() else np.float32(0)
    if template.all_valid and search.all_valid:
        # Means are taken off first: single precision would lose small contrast on large values.
        t = template.values - template.values.mean()
        found = cv2.matchTemplate(search.values - mean, t, cv2.TM_CCOEFF_NORMED)
        return np.asarray(found, np.float32)
    tm, sm = (window.valid.astype(np.float32) for window in (template, search))
    own_mean = np.float32(template.values[template.valid].mean()) if template.valid.any() else mean
    t, s = (template.values - own_mean) * tm, (search.values - mean) * sm
    # Each of a window's three spectra serves several sums.
    of_t, of_s = _spectra(np.stack([tm, t, t * t]), np.stack([sm, s, s * s]), search.valid.shape)
    pairs = ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2))
    products = np.stack([of_t[i].conj() * of_s[j] for i, j in pairs])
    spans = _spans(template.valid.shape, search.valid.shape)
    count, sum_t, sum_s, sum_ts, sum_tt, sum_ss = _inverse(products, search.valid.shape, spans)
    count = np.maximum(count, 1)
    covariance = sum_ts - sum_t * sum_s / count
    variance_t, variance_s = sum_tt - sum_t**2 / count, sum_ss - sum_s**2 / count
    product = variance_t * variance_s
    floor = 1e-6 * max(float(product.max(initial=0)), 1e-12)
    return np.where(product > floor, covariance / np.sqrt(np.maximum(product, floor)), 0)
