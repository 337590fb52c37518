"""Correlation of two squared orientation fields, one of them rotated, scaled and shifted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..rasters.averaging import area_average
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from ..similarity.orientation import orientation_fields
from ..similarity.surface import Surface
from .pose import Pose

Spectrum = NDArray[np.complex64]

# Structure that a whole image shares, such as the direction of its fields, matches anywhere. It is
# subtracted as the field's Gaussian mean of this width, in pixels of the level.
_TREND_PX = 8.0

# Below this share of the largest possible overlap, the weight no longer grows.
_SMALL_OVERLAP = 0.2

# Energies vary slowly, and are averaged over squares of this side.
_COARSE = 4


@dataclass(frozen=True)
class Field:
    """The orientation field of a reduced image.

    Parameters
    ----------
    parts
        Real and imaginary part, shape (h, w, 2) float32, 0 where invalid.
    pixel_px
        Side of its pixels in pixels of the image.
    """

    parts: FloatImage
    pixel_px: float

    @classmethod
    def of(cls, patch: Patch, pixel_px: float) -> Field:
        """Return the field of an image averaged to larger pixels around the same centre."""
        size = max(pixel_px, 1.0)
        edges = []
        for side in patch.values.shape:
            count = max(int(side / size + 1e-6), 1)
            even = (side - count * size) / 2 + size * np.arange(count + 1)
            edges.append(np.clip(even, 0, side))
        reduced = patch if size == 1 else Patch(*area_average(patch.values, patch.valid, *edges))
        field = orientation_fields(reduced)[0]
        return cls(np.ascontiguousarray(np.stack([field.real, field.imag], -1)), size)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width."""
        return self.parts.shape[0], self.parts.shape[1]

    @cached_property
    def energy(self) -> FloatImage:
        """Squared magnitude, shape (h, w)."""
        return _energy(self.parts)

    @cached_property
    def density(self) -> float:
        """Mean energy where there is any."""
        filled = self.energy[self.energy > 0]
        return float(filled.mean()) if filled.size else 0.0

    def resampled(self, reference: Field, pose: Pose, border: int) -> FloatImage:
        """Return the field of an input with this pose, resampled to a reference's pixels.

        Shape (h + 2 border, w + 2 border, 2). The gradient rotates with the image, and its square,
        the field, by twice the angle; that rotation is left to the caller.
        """
        linear = pose.linear * reference.pixel_px / self.pixel_px
        shape = [side + 2 * border for side in reference.shape]
        middle, own = (
            np.array([(width - 1) / 2, (height - 1) / 2]) for height, width in (shape, self.shape)
        )
        shift = np.array(pose.shift_px) / self.pixel_px
        matrix = np.column_stack([linear, own + shift - linear @ middle])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(self.parts, matrix, shape[::-1], flags=flags))


@dataclass(frozen=True)
class Template:
    """A reference's field, prepared for a search within a radius.

    Parameters
    ----------
    field
        The field, shape (h, w).
    radius
        Largest shift, in the field's pixels; even.
    """

    field: Field
    radius: int

    def surface(self, input: Field, pose: Pose) -> Surface:
        """Return the similarity surface around a pose, in standard deviations of chance.

        Parameters
        ----------
        input
            The input's field, about as fine as the reference's at this pose.
        pose
            The assumed pose of the input.

        Returns
        -------
        Shape (2 radius + 1, 2 radius + 1): further shift of the input's content, down and right
        in the reference's pixels. Correlations are divided by their standard deviation for fields
        whose directions are random in every pixel.
        """
        spectra, energy = self._spectra_of(input, pose)
        return self._correlation(spectra, pose.rotation_deg) * self._weights(energy, input.density)

    def surfaces_both_ways(self, input: Field, pose: Pose) -> tuple[Surface, Surface]:
        """Return the surfaces around a pose without shift, and around that pose plus 180°.

        An image rotated by 180° has the conjugate spectrum.
        """
        spectra, energy = self._spectra_of(input, pose)
        # Rotation by 180° makes the last pixel the first.
        top, left = (
            n - side - 2 * self.radius + 1
            for n, side in zip(self._shape, self.field.shape, strict=True)
        )
        upright = self._correlation(spectra, pose.rotation_deg)
        rotated = self._correlation(spectra.conj(), pose.rotation_deg, top, left)
        return (
            upright * self._weights(energy, input.density),
            rotated * self._weights(energy[::-1, ::-1], input.density),
        )

    def _spectra_of(self, input: Field, pose: Pose) -> tuple[Spectrum, FloatImage]:
        """Return the spectra of the input's parts, resampled by a pose, and its coarse energy."""
        parts = input.resampled(self.field, pose, self.radius)
        spectra = scipy.fft.rfft2(parts, self._shape, axes=(0, 1))
        return np.asarray(spectra), _coarse(_energy(parts))

    @property
    def _span(self) -> int:
        return 2 * self.radius + 1

    @cached_property
    def _shape(self) -> tuple[int, int]:
        return _fast_shape(self.field.shape, 2 * self.radius)

    @cached_property
    def _spectra(self) -> tuple[Spectrum, Spectrum]:
        """Conjugate spectra of the field's parts without their trend."""
        trend = cv2.GaussianBlur(self.field.parts, (0, 0), _TREND_PX)
        parts = np.where(self.field.energy[..., None] > 0, self.field.parts - trend, 0)
        spectra = scipy.fft.rfft2(parts.astype(np.float32), self._shape, axes=(0, 1)).conj()
        return np.ascontiguousarray(spectra[..., 0]), np.ascontiguousarray(spectra[..., 1])

    @cached_property
    def _energy_shape(self) -> tuple[int, int]:
        rows, cols = (-(-side // _COARSE) for side in self.field.shape)
        return _fast_shape((rows, cols), 2 * self.radius // _COARSE)

    @cached_property
    def _energy_spectrum(self) -> Spectrum:
        coarse = _coarse(self.field.energy)
        return np.asarray(scipy.fft.rfft2(coarse, self._energy_shape).conj())

    @cached_property
    def _between(self) -> FloatImage:
        """Matrix of linear interpolation from every `_COARSE`-th shift to all shifts."""
        nodes = np.arange(2 * self.radius // _COARSE + 1)
        at = np.arange(self._span)[:, None] / _COARSE - nodes
        return np.maximum(1 - np.abs(at), 0).astype(np.float32)

    def _correlation(
        self, spectra: Spectrum, rotation_deg: float, top: int = 0, left: int = 0
    ) -> FloatImage:
        """Return the correlation at all shifts, the first of which lies at `top` and `left`."""
        # Gradients rotate with the image, their squares by twice the angle.
        angle = 2 * np.radians(rotation_deg)
        cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        real, imaginary = self._spectra
        product = (cosine * real + sine * imaginary) * spectra[..., 0]
        product += (cosine * imaginary - sine * real) * spectra[..., 1]
        correlation = scipy.fft.irfft2(product, self._shape)
        return np.asarray(correlation[top : top + self._span, left : left + self._span])

    def _weights(self, coarse: FloatImage, density: float) -> FloatImage:
        """Return the reciprocal standard deviation of chance at each shift."""
        product = self._energy_spectrum * scipy.fft.rfft2(coarse, self._energy_shape)
        count = self._between.shape[1]
        sums = scipy.fft.irfft2(product, self._energy_shape)[:count, :count] * _COARSE**2
        floor = _SMALL_OVERLAP * float(self.field.energy.sum()) * density
        nodes = 1 / np.sqrt(np.maximum(sums, max(floor, 1e-9)) / 2)
        return np.asarray(self._between @ nodes.astype(np.float32) @ self._between.T)


def _energy(parts: FloatImage) -> FloatImage:
    return np.asarray(parts[..., 0] ** 2 + parts[..., 1] ** 2)


def _coarse(energy: FloatImage) -> FloatImage:
    """Return means over squares that start at the first pixel; 0 beyond the border."""
    kernel = (_COARSE, _COARSE)
    means = cv2.blur(energy, kernel, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT)
    return np.ascontiguousarray(means[::_COARSE, ::_COARSE])


def _fast_shape(shape: tuple[int, int], more: int) -> tuple[int, int]:
    rows, cols = (scipy.fft.next_fast_len(side + more, real=True) for side in shape)
    return rows, cols
