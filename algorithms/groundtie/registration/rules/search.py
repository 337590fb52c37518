"""Rules on a search or a fit that came to no transform."""

from __future__ import annotations

from ...errors import AmbiguousPlaceError, NothingFoundError, TooFewPointsError
from ..evidence import SearchEvidence
from .rule import WIDER, Rule


def _ambiguous(evidence: SearchEvidence) -> str | None:
    failure = evidence.failure
    return str(failure) if isinstance(failure, AmbiguousPlaceError) else None


def _nothing_found(evidence: SearchEvidence) -> str | None:
    failure = evidence.failure
    is_none = isinstance(failure, NothingFoundError) and not isinstance(
        failure, AmbiguousPlaceError
    )
    return str(failure) if is_none else None


def _too_few_points(evidence: SearchEvidence) -> str | None:
    failure = evidence.failure
    return str(failure) if isinstance(failure, TooFewPointsError) else None


SEARCH_RULES: tuple[Rule, ...] = (
    Rule(
        "second place",
        "a second place matches about as well as the best: half of its evidence (log10), or "
        "keypoints that agree on a second transform",
        "suite crossings and repetitive scenes",
        "give a larger part of the scene, or a matching pixel size that shows more than what "
        "repeats",
        _ambiguous,
        is_final=True,
    ),
    Rule(
        "nothing in common",
        "no place matches better than random ones would",
        "expected false alarms above 1; [Moisan2004]",
        f"{WIDER} (with coregister, match_sar_sar or match_optical)",
        _nothing_found,
    ),
    Rule(
        "too few points",
        "fewer points match, or agree, than the model needs",
        "number of parameters of the model",
        "give a larger part of the scene, or a simpler model",
        _too_few_points,
    ),
)
