"""All pose searches, by the names under which users compare them."""

from __future__ import annotations

from types import MappingProxyType
from typing import Protocol

from ..context import Context
from ..geometry.limits import SearchLimits
from ..pose.pose import PoseFound
from ..pose.search import find_poses
from ..rasters.patch import Patch
from ..similarity.surface import SimilaritySettings
from .climbing import ClimbingSearch
from .fourier_mellin import fourier_mellin
from .phase_correlation import phase_correlation
from .radon import radon
from .simplex import nelder_mead, powell
from .spsa import discrete_spsa, spsa, spsa_second_order

DEFAULT_SEARCH = "rotation-steps"


class PoseSearch(Protocol):
    """A search for the pose of an input window in a reference window, as `find_poses` does.

    Parameters
    ----------
    settings
        Similarity of the searches that climb a joint-histogram measure.
    """

    def __call__(
        self,
        reference: Patch,
        input: Patch,
        limits: SearchLimits,
        settings: SimilaritySettings,
        context: Context,
    ) -> list[PoseFound]:
        """Search within limits; return candidates, best first."""


def rotation_steps(
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    settings: SimilaritySettings,
    context: Context,
) -> list[PoseFound]:
    """Search as registrations do: by orientation fields, whatever the similarity."""
    return find_poses(reference, input, limits, context)


SEARCHES = MappingProxyType[str, PoseSearch](
    {
        DEFAULT_SEARCH: rotation_steps,
        "fourier-mellin": fourier_mellin,
        "radon": radon,
        "phase-correlation": phase_correlation,
        "spsa": spsa,
        "spsa2": spsa_second_order,
        "discrete-spsa": discrete_spsa,
        "powell": powell,
        "nelder-mead": nelder_mead,
    }
)

# Searches that climb a joint-histogram measure; the others correlate orientation fields or grey
# values.
HISTOGRAM_SEARCHES = frozenset(
    name for name, search in SEARCHES.items() if isinstance(search, ClimbingSearch)
)
