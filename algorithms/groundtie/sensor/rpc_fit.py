"""Fitting RPCs to pairs of ground and image positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import TooFewPointsError
from ..rasters.grid import FloatArray
from .polynomials import TERMS, fill_terms
from .rpc import RPC

# Unknowns of a ratio: two polynomials, less the denominator's first coefficient, which is 1.
_UNKNOWNS = 2 * TERMS - 1

# Keeps coefficients small that the ground positions hardly determine: a perspective image, for one,
# leaves many undetermined. It is of the size of an exact fit's rounding errors.
_RIDGE = 1e-9

# Number of heights, over the RPCs' range, of the positions that they are fitted to.
HEIGHTS = 7

# Number of fits: the denominator, which weights the residuals, improves with each.
_FITS = 4


@dataclass(frozen=True)
class RPCFit:
    """Fitted RPCs, and the largest residual of the fit, in pixels."""

    rpc: RPC
    largest_residual_px: float


def fit_rpc(lon_lat: ArrayLike, height_m: ArrayLike, px: ArrayLike, **stated: Any) -> RPCFit:
    """Fit RPCs to pairs of ground and image positions by regularised least squares.

    The equations are linearised by multiplying with the denominator, and weighted by the inverse of
    the denominator of the previous fit [Tao2001].

    Parameters
    ----------
    lon_lat
        Longitude and latitude in degrees, shape (n, 2); usually spread over the scene at
        several heights (see `rpc.image_places`).
    height_m
        Height above the ellipsoid, shape (n,).
    px
        Image positions (col, row), shape (n, 2).
    stated
        Further fields of `RPC`, such as its errors.

    Raises
    ------
    TooFewPointsError
        Fewer pairs than a ratio of polynomials has coefficients.
    """
    ground = np.column_stack([np.asarray(lon_lat, float), np.asarray(height_m, float)])
    px = np.asarray(px, float)
    if len(ground) < _UNKNOWNS:
        raise TooFewPointsError(f"RPCs need at least {_UNKNOWNS} positions, not {len(ground)}")
    offset, scale = _frame(ground)
    image_offset, image_scale = _frame(px)
    terms = np.empty((TERMS, len(ground)))
    fill_terms(((ground - offset) / scale).T, terms)
    target = ((px - image_offset) / image_scale).T
    sample, line = (_fit_ratio(terms.T, y) for y in target)
    rpc = RPC(
        tuple(offset.tolist()),
        tuple(scale.tolist()),
        tuple(image_offset.tolist()),
        tuple(image_scale.tolist()),
        (*sample, *line),
        **stated,
    )
    miss = np.hypot(*(rpc.project(ground[:, :2], ground[:, 2]) - px).T)
    return RPCFit(rpc, float(miss.max()))


def _frame(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    low, high = values.min(axis=0), values.max(axis=0)
    return (low + high) / 2, np.where(high > low, (high - low) / 2, 1.0)


def _fit_ratio(
    terms: FloatArray, target: FloatArray
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return numerator and denominator, 20 coefficients each, of the ratio nearest to a target."""
    design = np.hstack([terms, -target[:, None] * terms[:, 1:]])
    ridge = _RIDGE * np.sqrt(len(terms)) * np.eye(_UNKNOWNS)
    weight = np.ones(len(terms))
    for _ in range(_FITS):
        system = np.vstack([design * weight[:, None], ridge])
        known = np.concatenate([target * weight, np.zeros(_UNKNOWNS)])
        found = np.linalg.lstsq(system, known, rcond=None)[0]
        denominator = np.concatenate([[1.0], found[TERMS:]])
        weight = 1 / (terms @ denominator)
    return tuple(found[:TERMS].tolist()), tuple(denominator.tolist())
