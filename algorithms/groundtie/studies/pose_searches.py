"""All searches for a pose, by the names that users choose them by."""

from __future__ import annotations

from types import MappingProxyType

from ..pose.phase_correlation import phase_correlation
from ..pose.pose import PoseSearch
from ..pose.rotation_steps import rotation_steps
from .fourier_mellin import fourier_mellin
from .radon import radon
from .simplex import nelder_mead, powell
from .spsa import discrete_spsa, spsa, spsa_second_order

DEFAULT_SEARCH = "rotation-steps"

# Those that climb a joint histogram; all others correlate orientation fields or grey values.
HISTOGRAM_SEARCHES = frozenset({"spsa", "spsa2", "discrete-spsa", "powell", "nelder-mead"})

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
