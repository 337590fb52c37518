"""Corrections of RPCs in image space, and folding them into the coefficients.

RPCs are in error because the satellite's attitude and position are. Over a scene, this moves image
positions by a shift, drifts along the lines, or an affine change [Fraser2003].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..geometry.models import monomials
from ..rasters.grid import FloatArray
from .rpc import RPC, image_places
from .rpc_fit import HEIGHTS, RPCFit, fit_rpc

# Number of terms of each model, an axis, from the simplest to the most flexible.
SHIFT = "shift"
TERMS = {SHIFT: 1, "shift_drift": 2, "affine": 3}
KINDS = tuple(TERMS)


@dataclass(frozen=True)
class Bias:
    """A correction that is added to the image positions of RPCs.

    Parameters
    ----------
    kind
        One of `KINDS`.
    size
        Width and height of the image, pixels.
    coefficients
        Column and row of the correction, px, for each term; shape (terms, 2). Terms are 1, the
        row and the column, within ±1 over the image.
    covariance
        Covariance of the raveled coefficients, px²; shape (2 terms, 2 terms).
    """

    kind: str
    size: tuple[int, int]
    coefficients: FloatArray
    covariance: FloatArray

    def __call__(self, px: ArrayLike) -> FloatArray:
        """Return the corrections (col, row), shape (n, 2), at image positions of the RPCs."""
        return design(self.kind, self.size, np.asarray(px, float)) @ self.coefficients

    def shift_px(self) -> tuple[list[float], list[float]]:
        """Return the correction at the centre of the image (col, row), and its sigma, pixels."""
        sigma = np.sqrt(np.diag(self.covariance))[:2]
        return self.coefficients[0].tolist(), sigma.tolist()

    def sigma_px(self, px: ArrayLike) -> FloatArray:
        """Return the standard deviation of the corrections, both axes, shape (n,), in pixels."""
        terms = design(self.kind, self.size, np.asarray(px, float))
        count = terms.shape[1]
        blocks = self.covariance.reshape(count, 2, count, 2)
        variance = np.einsum("ni,iajb,nj->nab", terms, blocks, terms)
        return np.asarray(np.sqrt(np.trace(variance, axis1=1, axis2=2)))

    def to_json(self) -> dict[str, Any]:
        """Return the correction as JSON values."""
        names = ("constant", "row", "col")[: len(self.coefficients)]
        sigma = np.sqrt(np.diag(self.covariance)).reshape(-1, 2)
        return {
            "model": self.kind,
            "terms": {
                name: {"col_px": c[0], "row_px": c[1], "sigma_col_px": s[0], "sigma_row_px": s[1]}
                for name, c, s in zip(
                    names, self.coefficients.tolist(), sigma.tolist(), strict=True
                )
            },
            "covariance_px2": self.covariance.tolist(),
        }


def design(kind: str, size: tuple[int, int], px: FloatArray) -> FloatArray:
    """Return the terms of a model at image positions, shape (n, terms)."""
    middle = (np.array(size) - 1) / 2
    unit = (px - middle) / (np.array(size) / 2)
    return monomials(unit[:, ::-1], 1)[:, : TERMS[kind]]


def fold(rpc: RPC, bias: Bias) -> RPCFit:
    """Return RPCs that include a correction, and their largest residual from it.

    A shift moves the offsets, which is exact. Other models are absorbed by a new fit to positions
    over the image and the RPCs' range of heights.
    """
    if bias.kind == SHIFT:
        return RPCFit(rpc.shifted(bias.coefficients[0]), 0.0)
    px, height = image_places(bias.size, np.linspace(*rpc.heights_m(), HEIGHTS))
    lon_lat = rpc.localise(px, height)
    seen = np.isfinite(lon_lat).all(axis=1)
    lon_lat, height = lon_lat[seen], height[seen]
    px = rpc.project(lon_lat, height)
    stated = {"error_bias_m": rpc.error_bias_m, "error_random_m": rpc.error_random_m}
    return fit_rpc(lon_lat, height, px + bias(px), **stated)
