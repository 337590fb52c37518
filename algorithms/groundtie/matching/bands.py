"""Bands of one image that show another place than those that are matched.

Bands of one exposure coincide: they show one place. Where some do not, they are matched apart:
radar beside a camera's bands matches there, too, masks match nowhere, and other ground elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.models import Model
from ..rasters.pair import Image
from ..rasters.reading import FloatImage, Mask, RasterSource, Window
from ..similarity.surface import SimilaritySettings
from .chips import ChipMatcher
from .matcher import Places
from .parts import SAME_PX
from .survey import SURVEY_RADIUS_PX, Survey, survey_model

# Of many bands, so many are asked, evenly spaced: one that does not coincide with the others takes
# as long as the survey.
_MOST_BANDS = 4

# Bands are compared with each other in so many windows along each side of the image, of this side,
# as far off as surveys see what lies elsewhere.
_ALONG, _WINDOW_PX = 3, 128
_PADDED_PX = _WINDOW_PX + SURVEY_RADIUS_PX

# Edges stand out from what is around them within this: where there are many is no edge.
_AROUND_PX = 31

_Spectrum = NDArray[np.complexfloating]


@dataclass(frozen=True)
class BandSurvey:
    """Where chips match in one band alone.

    Parameters
    ----------
    image
        "reference" or "input".
    band
        Number of the band, from 1.
    survey
        What they show.
    """

    image: str
    band: int
    survey: Survey


def survey_bands(
    matcher: ChipMatcher, model: Model, places: Places, elsewhere_px: float, context: Context
) -> tuple[BandSurvey, ...]:
    """Return what bands show that do not coincide with others of their image, on either image.

    Of those that coincide with one another, one is asked, and none where a chosen band is matched.

    Parameters
    ----------
    matcher
        What the chips are matched by.
    model
        What was found.
    places
        The chips.
    elsewhere_px
        See `Survey`.
    context
        Threads and progress.
    """
    pair, quiet = matcher.pair, context.quiet()
    found = []
    for name, image in (("reference", pair.reference), ("input", pair.input)):
        for band in _bands_apart(image):
            one = replace(image, band=band, colours=None)
            is_reference = image is pair.reference
            alone = replace(pair, reference=one) if is_reference else replace(pair, input=one)
            seen = replace(matcher, pair=alone, settings=SimilaritySettings())
            survey = survey_model(seen, model, quiet, None, places, elsewhere_px)
            found.append(BandSurvey(name, band, survey))
    return tuple(found)


def _bands_apart(image: Image) -> list[int]:
    """Return one band of each of the groups that do not coincide; none where all do."""
    every = image.source.image_bands
    if len(every) < 2:
        return []
    at = np.linspace(0, len(every) - 1, min(len(every), _MOST_BANDS)).round().astype(int)
    # A chosen one was matched, and stands for those that coincide with it.
    bands = list(dict.fromkeys([*([image.band] if image.band else []), *(every[k] for k in at)]))
    edges = _coinciding(image.source, bands)
    if edges[0, 1:].all():
        return []
    from scipy.sparse.csgraph import connected_components  # takes 0.1 s to import

    count, groups = connected_components(edges, directed=False)
    if count == 1:
        return []
    firsts = [bands[int(np.argmax(groups == group))] for group in range(count)]
    return [band for band in firsts if band != image.band]


def _coinciding(source: RasterSource, bands: list[int]) -> NDArray[np.bool_]:
    """Return which two bands' edges correlate best where the bands lie on one another, (n, n)."""
    spectra = [_spectra(source, window, bands) for window in _windows(source)]
    shift = np.arange(-SURVEY_RADIUS_PX, SURVEY_RADIUS_PX + 1)
    is_here = np.hypot(*np.meshgrid(shift, shift)) <= SAME_PX
    # The more windows are moved, the less of them is compared.
    overlap = np.outer(*2 * [_WINDOW_PX - np.abs(shift)])
    coincide = np.zeros((len(bands), len(bands)), bool)
    for one, other in combinations(range(len(bands)), 2):
        products = np.sum([of[one] * of[other].conj() for of in spectra], axis=0)
        surface = np.fft.irfft2(products, (_PADDED_PX, _PADDED_PX))[np.ix_(shift, shift)]
        coincide[one, other] = is_here.flat[np.argmax(surface / overlap)]
    return coincide


def _windows(source: RasterSource) -> Iterator[Window]:
    """Yield windows all over a raster, and beyond it where it is small."""
    grid = source.grid
    for row in np.linspace(0, max(grid.height - _WINDOW_PX, 0), _ALONG).astype(int):
        for col in np.linspace(0, max(grid.width - _WINDOW_PX, 0), _ALONG).astype(int):
            yield Window(int(col), int(row), _WINDOW_PX, _WINDOW_PX)


def _spectra(source: RasterSource, window: Window, bands: list[int]) -> _Spectrum:
    """Return the spectra of the lengths of bands' gradients, each of the same power."""
    values, valid = source.read_bands(window, bands)
    images = np.abs(values).astype(np.float32)
    known = np.asarray(valid.all(axis=0), np.uint8)
    inside: Mask = np.asarray(cv2.erode(known, np.ones((3, 3), np.uint8)) > 0)
    edges = np.stack(
        [np.hypot(cv2.Sobel(one, -1, 1, 0), cv2.Sobel(one, -1, 0, 1)) for one in images]
    )
    edges = np.where(inside, edges, 0)
    share = np.maximum(_mean(inside.astype(np.float32)), np.finfo(np.float32).eps)
    usual = np.stack([_mean(one) for one in edges]) / share
    edges = np.where(inside, edges - usual, 0)
    power = np.sqrt((edges**2).sum(axis=(1, 2), keepdims=True))
    edges = edges / np.maximum(power, np.finfo(np.float32).tiny)
    return np.asarray(np.fft.rfft2(edges, (_PADDED_PX, _PADDED_PX)))


def _mean(image: FloatImage) -> FloatImage:
    return np.asarray(cv2.blur(image, (_AROUND_PX, _AROUND_PX)), np.float32)
