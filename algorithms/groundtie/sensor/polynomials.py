"""The cubic polynomials of RPCs, evaluated block by block so that all intermediates stay in cache.

The twenty terms of a block form a matrix; one product with the coefficients gives all polynomials.
numpy releases the interpreter's lock for both, so that blocks can be worked side by side.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..rasters.grid import FloatArray

TERMS = 20
_QUADRATIC = 10

# Exponents of longitude L, latitude P and height H in the order of RPC00B (STDI-0002, E.2.4):
# 1, L, P, H, LP, LH, PH, L², P², H², PLH, L³, LP², LH², L²P, P³, PH², L²H, P²H, H³.
EXPONENTS = (
    (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1),
    (2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 1), (3, 0, 0), (1, 2, 0), (1, 0, 2),
    (2, 1, 0), (0, 3, 0), (0, 1, 2), (2, 0, 1), (0, 2, 1), (0, 0, 3),
)  # fmt: skip

# Terms of degree above 1 as products: of which earlier term, and of which coordinate.
_PRODUCTS = (
    (4, 1, 1), (5, 1, 2), (6, 2, 2), (7, 1, 0), (8, 2, 1), (9, 3, 2), (10, 4, 2), (11, 7, 0),
    (12, 8, 0), (13, 9, 0), (14, 7, 1), (15, 8, 1), (16, 9, 1), (17, 7, 2), (18, 8, 2), (19, 9, 2),
)  # fmt: skip

# Points whose terms fit into the cache of a core.
BLOCK = 4096


def fill_terms(lph: FloatArray, terms: FloatArray) -> None:
    """Write the terms, (20, n), of normalised positions L, P, H, (3, n)."""
    terms[0] = 1.0
    terms[1:4] = lph
    for term, factor, coordinate in _PRODUCTS:
        np.multiply(terms[factor], lph[coordinate], out=terms[term])


def derivative(coefficients: FloatArray, coordinate: int) -> FloatArray:
    """Return the coefficients, (m, 10), of derivatives of polynomials, (m, 20).

    Derivatives are quadratic: they need the first ten terms only.

    Parameters
    ----------
    coefficients
        One polynomial a row.
    coordinate
        By which to derive: 0 longitude, 1 latitude, 2 height.
    """
    lower = np.zeros((len(coefficients), _QUADRATIC))
    for term, exponents in enumerate(EXPONENTS):
        power = exponents[coordinate]
        if power:
            reduced = tuple(e - (i == coordinate) for i, e in enumerate(exponents))
            lower[:, EXPONENTS.index(reduced)] += power * coefficients[:, term]
    return lower


def in_blocks(
    work: Callable[[slice, FloatArray], None], count: int, workers: int, terms: int = TERMS
) -> None:
    """Call `work` for all blocks of `count` points, with a matrix for the terms of each.

    Parameters
    ----------
    work
        Takes the points' range and a matrix, (terms, points), that it may overwrite.
    count
        Number of points.
    workers
        Number of threads; each works on a run of neighbouring blocks.
    terms
        Rows of the matrix.
    """

    def run(first: int, stop: int) -> None:
        matrix = np.empty((terms, min(BLOCK, stop - first)))
        for start in range(first, stop, BLOCK):
            end = min(start + BLOCK, stop)
            work(slice(start, end), matrix[:, : end - start])

    workers = min(workers, -(-count // BLOCK))
    if workers <= 1:
        if count:
            run(0, count)
        return
    edges = np.linspace(0, count, workers + 1).astype(int).tolist()
    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(run, *part) for part in itertools.pairwise(edges)]:
            done.result()
