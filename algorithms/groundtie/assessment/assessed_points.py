"""What a verdict on a registration that was made before rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ..registration.evidence import ASSESSMENT, ERROR, HeldOut
from .point_errors import PointErrors


@dataclass(frozen=True)
class AssessmentEvidence:
    """What the rules read of a registration that was made before.

    Parameters
    ----------
    name
        What the points are called.
    points
        Errors at points that took no part in the fit.
    max_error_px
        Largest root mean square error, in input pixels.
    misses_px
        Root mean square inconsistency of the ways back, by name; NaN: not measured.
    """

    name: str
    points: PointErrors
    max_error_px: float
    misses_px: Mapping[str, float]

    stages: ClassVar = (ASSESSMENT, ERROR)

    @property
    def held_out(self) -> HeldOut:
        """How the points agree; nothing is known of chance and of the model's spread."""
        used, count = int(self.points.used.sum()), len(self.points)
        rmse = self.points.in_pixels.rmse
        return HeldOut(self.name, used, count, math.nan, rmse, self.max_error_px, 0.0, "")
