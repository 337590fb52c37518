"""Rules on a search or a fit that found no transform."""

from __future__ import annotations

from collections.abc import Callable

from ...errors import AmbiguousPlaceError, GroundTieError, NothingFoundError, TooFewPointsError
from ..evidence import SearchEvidence
from .rule import Rule


def _ended_with(kind: type[GroundTieError]) -> Callable[[SearchEvidence], str | None]:
    def reason(evidence: SearchEvidence) -> str | None:
        # AmbiguousPlaceError is a NothingFoundError, too, but has a rule of its own.
        return str(evidence.failure) if type(evidence.failure) is kind else None

    return reason


SEARCH_RULES: tuple[Rule, ...] = (
    Rule(
        "second place",
        "a second place has more than half of the best place's evidence (log10)",
        "suite crossings and repetitive scenes",
        "give a larger part of the scene, or a matching pixel size that shows more than what "
        "repeats",
        _ended_with(AmbiguousPlaceError),
        is_final=True,
    ),
    Rule(
        "nothing in common",
        "no place matches better than random images would, or keypoints agree on a second "
        "transform, as keypoints of the ground and of elevated objects do",
        "expected false alarms above 1; [Moisan2004]",
        "check the band and the overlap; give a larger search radius, or allow rotation (where a "
        "tool has neither: with coregister, match_sar_sar or match_optical)",
        _ended_with(NothingFoundError),
    ),
    Rule(
        "too few points",
        "fewer points match, or agree, than the model needs",
        "number of parameters of the model",
        "give a larger part of the scene, or a simpler model",
        _ended_with(TooFewPointsError),
    ),
)
