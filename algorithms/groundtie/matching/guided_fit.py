"""Chips all over a pair, guided by its keypoints ([Patel2017] 4, [Suri2010] 6.9).

Keypoints locate an image whose bands or light differ from a coarse model that is many pixels off.
They lie where edges are strongest: on roofs, walls and crowns, which may be displaced against the
ground. Chips on a regular layout show everything by its area.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..context import Context
from ..geometry.estimation import Estimate
from ..geometry.models import Model
from .feature_fit import first_kind
from .keypoint_fit import KeypointFit
from .surface_fit import SurfaceFit


@dataclass(frozen=True)
class GuidedFit:
    """Fits a model to chips around the one that keypoints agree on.

    Parameters
    ----------
    keypoints
        Finds that model, by its matches alone.
    chips
        Fits the model; it sees no more than `keypoints`.
    """

    keypoints: KeypointFit
    chips: SurfaceFit

    def estimate(self, coarse: Model, kind: str, context: Context) -> Estimate:
        """Match keypoints near a coarse model and chips near theirs, and fit a model to the chips.

        Parameters and errors as `KeypointFit.estimate` has them; what "auto" chooses from is the
        chips' own.
        """
        # Keypoints need agree on no more to predict where chips match; few matches are enough.
        first = self.keypoints.estimate(coarse, first_kind(kind), context.part(0.0, 0.6))
        return self.chips.estimate(first.transform.model, kind, context.part(0.6, 1.0))
