"""Rational polynomial coefficients (RPC): ground position ↔ image position.

An image position is a ratio of two cubic polynomials of longitude, latitude and height above the
ellipsoid (STDI-0002 volume 1, appendix E: RPC00B). Lines and samples count from the centre of the
first pixel, which lies at 0: they are the (col, row) of arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..rasters.grid import LON_LAT, FloatArray, near_longitude
from .polynomials import TERMS, derivative, fill_terms, in_blocks

# The inverse has converged when it misses the image position by less, in pixels.
_PRECISION_PX = 1e-7

# Most steps until convergence; usually there is one (see `RPC._start`).
_STEPS = 12

# Ground positions beyond this multiple of the RPCs' scales lie outside of the image.
VALID_RANGE = 1.5

# Nodes along longitude, latitude and height of the positions that the inverse's start is fitted to.
_START_NODES = (9, 9, 5)


@dataclass(frozen=True)
class RPC:
    """A rational polynomial model of a sensor.

    Parameters
    ----------
    offset, scale
        Of longitude (degrees), latitude (degrees) and height (metres above the ellipsoid).
    image_offset, image_scale
        Of column (sample) and row (line), in pixels; the first pixel's centre is at (0, 0).
    polynomials
        Twenty coefficients each, in the order of RPC00B: numerator and denominator of the sample,
        numerator and denominator of the line.
    error_bias_m, error_random_m
        Root mean square errors that the supplier states, metres; None: not stated.
    """

    offset: tuple[float, float, float]
    scale: tuple[float, float, float]
    image_offset: tuple[float, float]
    image_scale: tuple[float, float]
    polynomials: tuple[tuple[float, ...], ...]
    error_bias_m: float | None = None
    error_random_m: float | None = None

    def __post_init__(self) -> None:
        if any(len(row) != TERMS for row in self.polynomials):
            raise ValueError("an RPC polynomial has 20 coefficients")
        numbers = np.concatenate([self.offset, self.image_offset, *self.polynomials])
        scales = np.array([*self.scale, *self.image_scale])
        if not np.isfinite(numbers).all() or not np.isfinite(scales).all() or not scales.all():
            raise ValueError("the RPCs hold numbers that are not finite, or scales of 0")

    @cached_property
    def _coefficients(self) -> FloatArray:
        """Numerators, then denominators, of column and row, shape (4, 20)."""
        return np.array(self.polynomials)[[0, 2, 1, 3]]

    @cached_property
    def _derivatives(self) -> FloatArray:
        """Coefficients, (8, 10), of the derivatives by longitude, then of those by latitude."""
        return np.concatenate([derivative(self._coefficients, axis) for axis in (0, 1)])

    def project(self, lon_lat: ArrayLike, height_m: ArrayLike) -> FloatArray:
        """Return the image positions (col, row), shape (n, 2), of ground positions.

        Parameters
        ----------
        lon_lat
            Longitude and latitude in degrees (WGS 84), shape (n, 2).
        height_m
            Height above the ellipsoid, shape (n,) or one for all.
        """
        lon_lat, height = _at_heights(lon_lat, height_m)
        px = np.empty((len(lon_lat), 2))

        def work(part: slice, terms: FloatArray) -> None:
            # Positions outside of their map projection are infinite.
            with np.errstate(all="ignore"):
                fill_terms(self._normalised(lon_lat[part], height[part]), terms)
                values = self._coefficients @ terms
                ratio = values[:2] / values[2:]
            px[part] = ratio.T * self.image_scale + self.image_offset

        in_blocks(work, len(px))
        return px

    def localise(self, px: ArrayLike, height_m: ArrayLike) -> FloatArray:
        """Return longitude and latitude, shape (n, 2), of image positions at given heights.

        By Newton's method with the analytic Jacobian, to 1e-7 px; NaN where it does not converge.

        Parameters
        ----------
        px
            Image positions (col, row), shape (n, 2).
        height_m
            As in `project`.
        """
        px, height = _at_heights(px, height_m)
        found = np.empty((len(px), 2))
        low, span, coefficients = self._start

        def work(part: slice, terms: FloatArray) -> None:
            target = ((px[part] - self.image_offset) / self.image_scale).T
            lph = np.empty_like(terms[:3])
            lph[2] = (height[part] - self.offset[2]) / self.scale[2]
            fill_terms(np.vstack([_unit(target, low, span), lph[2]]), terms)
            lph[:2] = coefficients @ terms
            with np.errstate(all="ignore"):
                self._newton(lph, target, terms)
            found[part] = lph[:2].T * self.scale[:2] + self.offset[:2]

        in_blocks(work, len(px))
        return found

    def heights_m(self, scales: float = 1.0) -> tuple[float, float]:
        """Return the lowest and highest height within a number of scales of the offset.

        RPCs are made for one scale, and may be used up to `VALID_RANGE` scales (see `is_valid`).
        """
        reach = scales * abs(self.scale[2])
        return self.offset[2] - reach, self.offset[2] + reach

    def is_valid(self, lon_lat: ArrayLike, height_m: ArrayLike) -> NDArray[np.bool_]:
        """Return at which ground positions the coefficients may be used, shape (n,).

        They are valid within 1.5 times the scales around the offsets: farther off, the polynomials
        may project ground outside of the scene into the image. Parameters as `project`.
        """
        lon_lat, height = _at_heights(lon_lat, height_m)
        inside = np.abs(self._normalised(lon_lat, height)) <= VALID_RANGE
        return np.asarray(inside.all(axis=0))

    def shifted(self, shift_px: ArrayLike) -> RPC:
        """Return the RPCs whose image positions are moved by a shift (col, row): exact."""
        dx, dy = np.asarray(shift_px, float).tolist()
        return replace(self, image_offset=(self.image_offset[0] + dx, self.image_offset[1] + dy))

    def _normalised(self, lon_lat: FloatArray, height: FloatArray) -> FloatArray:
        """Return normalised longitude, latitude and height, shape (3, n)."""
        lph = np.empty((3, len(lon_lat)))
        for axis, values in enumerate((lon_lat[:, 0], lon_lat[:, 1], height)):
            np.subtract(values, self.offset[axis], out=lph[axis])
        # Longitudes jump at the antimeridian.
        if (np.abs(lph[0]) > 180).any():
            lph[:2] = near_longitude(lph[:2].T, 0.0, LON_LAT).T
        lph *= 1 / np.array(self.scale)[:, None]
        return lph

    def _newton(self, lph: FloatArray, target: FloatArray, terms: FloatArray) -> None:
        """Move normalised positions, (3, n), in place until they project to targets, (2, n)."""
        size = np.abs(np.array(self.image_scale))[:, None]
        slopes = self._derivatives
        for _ in range(_STEPS):
            fill_terms(lph, terms)
            values = self._coefficients @ terms
            miss = target - values[:2] / values[2:]
            if np.nanmax(np.abs(miss) * size, initial=0.0) < _PRECISION_PX:
                break
            by_l, by_p = np.split(slopes @ terms[: slopes.shape[1]], 2)
            by_l, by_p = _quotient_slope(values, by_l), _quotient_slope(values, by_p)
            determinant = by_l[0] * by_p[1] - by_p[0] * by_l[1]
            lph[0] += (miss[0] * by_p[1] - miss[1] * by_p[0]) / determinant
            lph[1] += (miss[1] * by_l[0] - miss[0] * by_l[1]) / determinant
        lost = ~np.all(np.abs(miss) * size < _PRECISION_PX, axis=0)
        lph[:2, lost] = np.nan

    @property
    def is_regular(self) -> bool:
        """Whether no denominator vanishes within the scales, and column and row vary there."""
        values = self._coefficients @ _ground_terms()[1]
        low, high = values[2:].min(axis=1), values[2:].max(axis=1)
        if not (low * high > 0).all():
            return False
        extent = np.ptp(values[:2] / values[2:], axis=1)
        return bool(np.isfinite(extent).all() and (extent > 0).all())

    @cached_property
    def _start(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cubic polynomials from image position and height to longitude and latitude, normalised.

        They are fitted over the whole range of the RPCs and right to a few pixels, so that Newton's
        method needs one step.

        Returns
        -------
        low, span, coefficients
            Least image positions and their range, (2, 1) each, by which positions are brought to
            within ±1, and the coefficients, (2, 20).
        """
        lph, terms = _ground_terms()
        values = self._coefficients @ terms
        image = values[:2] / values[2:]
        low, span = image.min(axis=1, keepdims=True), np.ptp(image, axis=1, keepdims=True)
        fill_terms(np.vstack([_unit(image, low, span), lph[2]]), terms)
        coefficients = np.linalg.lstsq(terms.T, lph[:2].T, rcond=None)[0].T
        return low, span, np.ascontiguousarray(coefficients)


def image_places(
    size: tuple[int, int], heights_m: ArrayLike, nodes: int = 21
) -> tuple[FloatArray, FloatArray]:
    """Return positions all over an image, each at several heights, as `localise` takes them.

    Parameters
    ----------
    size
        Width and height of the image in pixels; positions reach to its corners.
    heights_m
        Heights above the ellipsoid.
    nodes
        Nodes along each side of the image.

    Returns
    -------
    px, height_m
        Shapes (n, 2) and (n,).
    """
    axes = [np.linspace(-0.5, side - 0.5, nodes) for side in size]
    cols, rows, heights = (x.ravel() for x in np.meshgrid(*axes, np.asarray(heights_m, float)))
    return np.column_stack([cols, rows]), heights


def _at_heights(positions: ArrayLike, height_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return positions, (n, 2), and the height of each, (n,)."""
    places = np.asarray(positions, float)
    return places, np.broadcast_to(np.asarray(height_m, float), len(places))


def _ground_terms() -> tuple[FloatArray, FloatArray]:
    """Return normalised ground positions all over the scales, (3, n), and their terms, (20, n)."""
    axes = [np.linspace(-1, 1, nodes) for nodes in _START_NODES]
    lph = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    terms = np.empty((TERMS, lph.shape[1]))
    fill_terms(lph, terms)
    return lph, terms


def _unit(image: FloatArray, low: FloatArray, span: FloatArray) -> FloatArray:
    return np.asarray(2 * (image - low) / span - 1)


def _quotient_slope(values: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return the derivatives, (2, n), of ratios from values and derivatives, (4, n) each."""
    with np.errstate(all="ignore"):
        ratio = values[:2] / values[2:]
        return np.asarray((slopes[:2] - ratio * slopes[2:]) / values[2:])
