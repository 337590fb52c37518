"""Polynomials of positions, evaluated block by block so that all intermediates stay in cache.

The terms of a block form a matrix; one product with the coefficients gives all polynomials.
numpy releases the interpreter's lock for both, so that threads run in parallel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..rasters.grid import FloatArray

# Exponents of longitude L, latitude P and height H in the order of RPC00B (STDI-0002, E.2.4):
# 1, L, P, H, LP, LH, PH, L², P², H², PLH, L³, LP², LH², L²P, P³, PH², L²H, P²H, H³.
EXPONENTS = (
    (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1),
    (2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 1), (3, 0, 0), (1, 2, 0), (1, 0, 2),
    (2, 1, 0), (0, 3, 0), (0, 1, 2), (2, 0, 1), (0, 2, 1), (0, 0, 3),
)  # fmt: skip

TERMS = len(EXPONENTS)
_QUADRATIC = sum(sum(term) <= 2 for term in EXPONENTS)

# Terms of degree above 1 as products: index of an earlier term, and of a coordinate.
RPC_PRODUCTS = (
    (1, 1), (1, 2), (2, 2), (1, 0), (2, 1), (3, 2), (4, 2), (7, 0),
    (8, 0), (9, 0), (7, 1), (8, 1), (9, 1), (7, 2), (8, 2), (9, 2),
)  # fmt: skip

# Number of points whose terms fit into the cache of a core.
BLOCK = 4096


def fill_terms(
    positions: FloatArray, terms: FloatArray, products: Sequence[tuple[int, int]] = RPC_PRODUCTS
) -> None:
    """Write the terms of a polynomial: 1, the coordinates, and the products.

    Parameters
    ----------
    positions
        Shape (k, n); for RPCs, normalised longitude, latitude and height.
    terms
        The output, shape (1 + k + products, n).
    products
        The terms of degree above 1: index of an earlier term, and of a coordinate.
    """
    terms[0] = 1.0
    terms[1 : 1 + len(positions)] = positions
    for term, (factor, coordinate) in enumerate(products, start=1 + len(positions)):
        np.multiply(terms[factor], positions[coordinate], out=terms[term])


def derivative(coefficients: FloatArray, coordinate: int) -> FloatArray:
    """Return the coefficients, (m, 10), of derivatives of polynomials, (m, 20).

    Derivatives are quadratic: they need the first ten terms only.

    Parameters
    ----------
    coefficients
        One polynomial a row.
    coordinate
        The coordinate to differentiate by: 0 longitude, 1 latitude, 2 height.
    """
    lower = np.zeros((len(coefficients), _QUADRATIC))
    for term, exponents in enumerate(EXPONENTS):
        power = exponents[coordinate]
        if power:
            reduced = tuple(e - (i == coordinate) for i, e in enumerate(exponents))
            lower[:, EXPONENTS.index(reduced)] += power * coefficients[:, term]
    return lower


def in_blocks(work: Callable[[slice, FloatArray], None], count: int, terms: int = TERMS) -> None:
    """Call `work` for each block of `count` points, with a matrix for its terms.

    Parameters
    ----------
    work
        Takes the points' range and a matrix, (terms, points), to overwrite.
    count
        Number of points.
    terms
        Rows of the matrix.
    """
    matrix = np.empty((terms, min(BLOCK, count)))
    for start in range(0, count, BLOCK):
        stop = min(start + BLOCK, count)
        work(slice(start, stop), matrix[:, : stop - start])
