"""Stripes of a pair that match elsewhere than a model predicts, narrower than chips.

Stripes filled from another date, swaths of two passes in turn, or lines that a sensor's jitter
displaced are a part of every chip, whose rest matches where the model predicts it. Their edges have
other directions than the reference's, so that lines along them agree less. The lines that agree
least are compared with the reference by themselves.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.transform import Transform
from ..rasters.grid import FloatArray, Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.correlation import correlate
from ..similarity.orientation import SCALES_PX, compress, squared_gradients
from ..similarity.surface import normalise
from .coarse_shift import LEVEL_SIDE_PX, level_factor
from .parts import FarPlace
from .survey import SURVEY_RADIUS_PX

# Large scenes are compared in pieces, spread over them, at half the resolution: stripes lie all
# over, but a reduced scene would not show those a few pixels wide.
_PIECE_PX, _MOST_ALONG = 2 * LEVEL_SIDE_PX, 3

# Directions that stripes may have, and how many of them are compared: those in which the agreement
# of lines varies most, as it does across stripes.
_DIRECTIONS, _COMPARED = 30, 8

# Share of the pixels, in the lines that agree least, that are compared. The gaps of Landsat 7,
# which are filled from other dates, hold 22 %.
_SHARE = 0.3

# Width over which lines are averaged: single ones agree by chance.
_WIDTH_PX = 9

# One scale, of middle size, is enough for sums over lines.
_SCALE = SCALES_PX[1:2]


def survey_stripes(
    pair: ImagePair, grid: Grid, transform: Transform, elsewhere_px: float, context: Context
) -> FarPlace:
    """Return where the lines of a pair that agree least match best, within a survey's radius.

    Parameters
    ----------
    pair
        The images.
    grid
        The grid that they are compared on.
    transform
        The transform that was found.
    elsewhere_px, context
        As `find_stripes`; in pixels of the grid, as are the result's shifts.
    """
    return _most_evident(
        [_of_piece(pair, piece, transform, elsewhere_px, context) for piece in _pieces(grid)]
    )


def _pieces(grid: Grid) -> list[Grid]:
    """Return pieces of a grid, spread over it, of which there are few."""
    width, height = (min(side, _PIECE_PX) for side in grid.size)
    firsts = (
        np.linspace(0, side - own, min(-(-side // own), _MOST_ALONG)).astype(int).tolist()
        for side, own in zip(grid.size, (width, height), strict=True)
    )
    return [grid.window(col, row, width, height) for col, row in product(*firsts)]


def _of_piece(
    pair: ImagePair, piece: Grid, transform: Transform, elsewhere_px: float, context: Context
) -> FarPlace:
    factor, reach = level_factor(piece), SURVEY_RADIUS_PX
    level = piece.scaled(factor)
    images = pair.reference_patch(level.widened(reach)), pair.input_patch(level, transform)
    return find_stripes(*images, reach, elsewhere_px / factor, context).scaled(factor)


def find_stripes(
    reference: Patch, input: Patch, radius_px: int, elsewhere_px: float, context: Context
) -> FarPlace:
    """Return where the lines of an input that agree least match best.

    Parameters
    ----------
    reference
        The reference, with a margin of `radius_px`.
    input
        The input as a model places it, shape (h, w).
    radius_px
        Largest shift.
    elsewhere_px
        Only peaks farther from the model's prediction lie elsewhere.
    context
        Threads.

    Returns
    -------
    Of all directions, the place elsewhere that exceeds the model's own most; heights are 0 if
    there is no peak elsewhere.
    """
    searched, field = (
        squared_gradients(compress(one), one.valid, _SCALE)[0] for one in (reference, input)
    )
    inside = slice(radius_px, -radius_px)
    lines = _least_agreeing(searched[inside, inside], field)

    def compared(hidden: NDArray[np.bool_]) -> FarPlace:
        surface = normalise(correlate(np.where(hidden, 0, field), searched))
        is_peak = surface >= cv2.dilate(surface, np.ones((3, 3), np.uint8))
        # Where the reference shows what the input's lines do: these are displaced the other way.
        return FarPlace.of(surface, elsewhere_px, elsewhere_px, is_peak).scaled(-1)

    return _most_evident(context.map(compared, lines))


def _most_evident(places: Iterable[FarPlace]) -> FarPlace:
    """Return the place that exceeds the model's own most."""
    return max(places, key=lambda place: place.height - place.own_height, default=FarPlace(0.0))


def _least_agreeing(
    reference: NDArray[np.complex64], input: NDArray[np.complex64]
) -> list[NDArray[np.bool_]]:
    """Return, for the directions compared, which pixels do not lie in the least agreeing lines."""
    agreement = reference.real * input.real + reference.imag * input.imag
    content = np.sqrt((reference.real**2 + reference.imag**2) * (input.real**2 + input.imag**2))
    if not content.any():
        return []
    # By chance, directions agree and disagree alike: the variance of a product is half its square.
    images = agreement, content, content**2 / 2
    angles = np.arange(_DIRECTIONS) * (np.pi / _DIRECTIONS)
    found = [_agreement_of_lines(_lines(content.shape, angle), *images) for angle in angles]
    most_varied = np.argsort([varies for varies, _ in found])[: -_COMPARED - 1 : -1]
    return [_not_least(_lines(content.shape, angles[n]), found[n][1]) for n in most_varied]


def _lines(shape: tuple[int, ...], angle: float) -> NDArray[np.intp]:
    """Return the number of the line, across a direction, in which each pixel lies."""
    rows, cols = (np.arange(side, dtype=np.float32) for side in shape)
    offset = np.add.outer(rows * np.float32(np.cos(angle)), cols * np.float32(np.sin(angle)))
    return (offset - offset.min()).astype(np.intp)


def _agreement_of_lines(
    line: NDArray[np.intp], agreement: FloatArray, content: FloatArray, variance: FloatArray
) -> tuple[float, FloatArray]:
    """Return how much the agreement of lines varies, and the mean of each, infinite if empty."""
    sums, contents = (_over_width(line, values) for values in (agreement, content))
    deviations = np.sqrt(_over_width(line, variance, 2))
    has_content = contents > 0
    means = np.full(len(sums), np.inf)
    np.divide(sums, contents, out=means, where=has_content)
    return float(np.std(sums[has_content] / deviations[has_content])), means


def _over_width(line: NDArray[np.intp], values: FloatArray, power: int = 1) -> FloatArray:
    """Return sums of values over lines, weighted over the width by a Hann window to a power."""
    weights = np.hanning(_WIDTH_PX + 2)[1:-1] ** power
    sums = np.bincount(line.ravel(), values.ravel())
    return np.convolve(sums, weights)[_WIDTH_PX // 2 :][: len(sums)]


def _not_least(line: NDArray[np.intp], means: FloatArray) -> NDArray[np.bool_]:
    """Return which pixels do not lie in the lines of least means, which hold a share of all."""
    order = np.argsort(means)
    pixels = np.cumsum(np.bincount(line.ravel())[order])
    is_least = np.zeros(len(means), bool)
    is_least[order[pixels <= _SHARE * pixels[-1]]] = True
    return ~is_least[line]
