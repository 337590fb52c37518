"""A push-broom camera in orbit: collinearity with a separate perspective centre for each line.

Positions are (x, y, height) in metres: map coordinates and heights above the ellipsoid, treated as
Cartesian. Over a scene of some kilometres the satellite flies straight and does not rotate, so that
both ground to image and image to ground have closed forms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..rasters.grid import FloatArray


@dataclass(frozen=True)
class PushBroom:
    """A moving detector line.

    Attributes
    ----------
    centre_px : float64 array (2,)
        Image position (col, row) whose line of sight is `view`.
    position_m : float64 array (3,)
        Perspective centre when the line of `centre_px` is exposed.
    step_m : float64 array (3,)
        Motion of the perspective centre from line to line.
    view, across : float64 array (3,)
        Perpendicular unit vectors: line of sight of the centre, and direction of columns.
    focal_px : float
        Focal length in detectors.
    """

    centre_px: FloatArray
    position_m: FloatArray
    step_m: FloatArray
    view: FloatArray
    across: FloatArray
    focal_px: float

    @classmethod
    def aimed(
        cls,
        target_m: tuple[float, float, float],
        size_px: tuple[int, int],
        pixel_m: float,
        view_azimuth_deg: float,
        off_nadir_deg: float,
        heading_deg: float,
        altitude_m: float,
    ) -> PushBroom:
        """Return the camera whose image is centred on a target.

        Parameters
        ----------
        target_m : tuple of float
            Ground position at the centre of the image.
        size_px : tuple of int
            Width and height of the image.
        pixel_m : float
            Line spacing on the ground, and pixel size at the target across the line of sight.
        view_azimuth_deg, off_nadir_deg : float
            Direction from the target to the camera, clockwise from north and from the vertical.
        heading_deg : float
            Flight direction, clockwise from north.
        altitude_m : float
            Height of the camera above the target.
        """
        azimuth, off_nadir, heading = np.radians([view_azimuth_deg, off_nadir_deg, heading_deg])
        upwards = np.array(
            [
                math.sin(azimuth) * math.sin(off_nadir),
                math.cos(azimuth) * math.sin(off_nadir),
                math.cos(off_nadir),
            ]
        )
        distance_m = altitude_m / math.cos(off_nadir)
        forward = np.array([math.sin(heading), math.cos(heading), 0.0])
        across = np.cross(forward, -upwards)
        return cls(
            (np.array(size_px) - 1) / 2,
            np.array(target_m) + distance_m * upwards,
            pixel_m * forward,
            -upwards,
            across / np.linalg.norm(across),
            distance_m / pixel_m,
        )

    def project(self, ground_m: FloatArray) -> FloatArray:
        """Return the image positions (col, row), shape (n, 2), of ground positions (n, 3).

        A point is imaged when the plane through the detector line and the perspective centre
        sweeps over it.
        """
        offset = ground_m - self.position_m
        normal = np.cross(self.view, self.across)
        lines = offset @ normal / (self.step_m @ normal)
        ray = offset - lines[:, None] * self.step_m
        columns = self.focal_px * (ray @ self.across) / (ray @ self.view)
        return np.column_stack([columns, lines]) + self.centre_px

    def localise(self, px: FloatArray, height_m: FloatArray | float) -> FloatArray:
        """Return the map positions (x, y), shape (n, 2), of image positions at heights.

        Heights have shape (n,), or are one number.
        """
        columns, lines = (px - self.centre_px).T
        origin = self.position_m + lines[:, None] * self.step_m
        ray = self.view + columns[:, None] / self.focal_px * self.across
        reach = (height_m - origin[:, 2]) / ray[:, 2]
        return np.asarray(origin[:, :2] + reach[:, None] * ray[:, :2])
