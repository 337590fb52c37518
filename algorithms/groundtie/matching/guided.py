"""Chips all over a pair, guided by its features (thesis P, chapter 4, and the chips of S 6.9).

Features tell where an image lies whose bands or light differ, from a rough model that is many
pixels off. They stand where edges are strongest: on roofs, walls and crowns, which may lie beside
the ground. Chips on a regular layout show everything by its area.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from ..geometry.estimation import Estimate
from ..geometry.models import Model
from ..progress import SILENT, Progress
from .hybrid import FeatureSearch
from .local import LocalSearch

# Features need agree on no more to tell where chips are looked for; few matches are enough.
_FIRST_KIND = "similarity"
_SIMPLER_KINDS = ("translation", "rigid")


@dataclass(frozen=True)
class GuidedSearch:
    """Finds the model of a pair by chips around the one that features agree on.

    Parameters
    ----------
    features
        Finds that model, by its matches alone.
    local
        Matches the chips; it sees no more than `features`.
    """

    features: FeatureSearch
    local: LocalSearch

    def estimate(
        self, coarse: Model, kind: str, seed: int, executor: Executor, progress: Progress = SILENT
    ) -> Estimate:
        """Match features near a rough model and chips near theirs, and fit a model to the chips.

        Parameters and errors as `FeatureSearch.estimate` has them; what "auto" chooses from is
        the local search's.
        """
        first_kind = kind if kind in _SIMPLER_KINDS else _FIRST_KIND
        first = self.features.estimate(coarse, first_kind, seed, executor, progress.part(0.0, 0.6))
        model = first.transform.model
        return self.local.estimate(model, kind, seed, executor, progress.part(0.6, 1.0))
