"""A polynomial in place of a map projection: the same positions, hundreds of times as fast."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..rasters.grid import FloatArray, PointFunction, mesh
from .polynomials import fill_terms, in_blocks

_DEGREE = 5

# Nodes a side: twice as many as the polynomial has coefficients along one.
_NODES = 2 * (_DEGREE + 1)

# Random positions at which the polynomial is compared with the exact function.
_CHECKS = 400

# Each term of degree above 1 is one of lower degree times u (0) or v (1), by rising degree.
_PRODUCTS = tuple(
    (total * (total - 1) // 2 + max(j - 1, 0), int(j > 0))
    for total in range(2, _DEGREE + 1)
    for j in range(total + 1)
)
_TERMS = len(_PRODUCTS) + 3


def smooth_map(
    exact: PointFunction, low: FloatArray, high: FloatArray, tolerance: float
) -> PointFunction:
    """Return a polynomial of degree 5 in place of a function over a box, or the function itself.

    The function itself, if the polynomial is not accurate enough. Outside of the box the polynomial
    is NaN.

    Parameters
    ----------
    exact
        Takes positions (n, 2) to positions (n, 2).
    low, high
        Corners of the box, shape (2,).
    tolerance
        Largest error at random positions in the box, in the result's unit.
    """
    nodes = np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)  # Chebyshev's
    unit = mesh(nodes, nodes).T
    checks = np.random.default_rng(0).uniform(-1, 1, (2, _CHECKS))
    terms = np.empty((_TERMS, unit.shape[1]))
    fill_terms(unit, terms, _PRODUCTS)
    values = exact((low + high) / 2 + unit.T * (high - low) / 2)
    if not np.isfinite(values).all():
        return exact
    coefficients = np.linalg.lstsq(terms.T, values, rcond=None)[0].T
    fitted = partial(_polynomial, low, high, np.ascontiguousarray(coefficients))
    places = (low + high) / 2 + checks.T * (high - low) / 2
    error = np.abs(fitted(places) - exact(places)).max()
    return fitted if error < tolerance else exact


def _polynomial(
    low: FloatArray, high: FloatArray, coefficients: FloatArray, xy: FloatArray
) -> FloatArray:
    """Return the polynomial, (n, 2), with coefficients (2, 21), at positions; NaN outside a box."""
    moved = np.empty((len(xy), 2))

    def work(part: slice, terms: FloatArray) -> None:
        unit = (2 * (xy[part] - low) / (high - low) - 1).T
        fill_terms(unit, terms, _PRODUCTS)
        moved[part] = (coefficients @ terms).T
        moved[part][(np.abs(unit) > 1 + 1e-9).any(axis=0)] = np.nan

    in_blocks(work, len(xy), terms=_TERMS)
    return moved
