"""The error of a sensor model, as a mapping from true to nominal image positions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError
from ..rasters.grid import FloatArray
from .noise import Stream, random_stream


@dataclass(frozen=True)
class AttitudeOptions:
    """Size of the error; its directions are random.

    Attributes
    ----------
    shift_m : float
        Length of the shift on the ground, an error of position, pitch and roll.
    drift_px : float
        Change of the shift from the first line to the last one.
    rotation_deg : float
        Rotation about the centre of the image, an error of yaw.
    """

    shift_m: float = 60.0
    drift_px: float = 2.0
    rotation_deg: float = 0.0

    def __post_init__(self) -> None:
        """Refuse options that cannot be simulated."""
        if self.shift_m < 0 or self.drift_px < 0 or abs(self.rotation_deg) > 1:
            raise ParameterError(
                "shift and drift must not be negative, the rotation of a sensor at most 1°"
            )


@dataclass(frozen=True)
class AttitudeError:
    """An affine map from true to nominal image positions (col, row).

    Attributes
    ----------
    matrix : float64 array (2, 3)
        Nominal position = matrix · (true column, true row, 1).
    """

    matrix: FloatArray

    @classmethod
    def draw(
        cls, options: AttitudeOptions, size_px: tuple[int, int], pixel_m: float, seed: int
    ) -> AttitudeError:
        """Draw the directions of shift and drift."""
        generator = random_stream(seed, Stream.ATTITUDE)
        azimuths = generator.uniform(0, 2 * math.pi, 2)
        shift, drift = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)
        turn = math.radians(options.rotation_deg)
        linear = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        linear[:, 1] += drift * options.drift_px / size_px[1]
        centre = (np.array(size_px) - 1) / 2
        moved = centre + shift * options.shift_m / pixel_m
        return cls(np.column_stack([linear, moved - linear @ centre]))

    def __call__(self, px: FloatArray) -> FloatArray:
        """Return the nominal positions, shape (n, 2), for true positions."""
        return np.asarray(px @ self.matrix[:, :2].T + self.matrix[:, 2])

    def inverse(self) -> AttitudeError:
        """Return the map from nominal to true positions."""
        linear = np.linalg.inv(self.matrix[:, :2])
        return AttitudeError(np.column_stack([linear, -linear @ self.matrix[:, 2]]))
