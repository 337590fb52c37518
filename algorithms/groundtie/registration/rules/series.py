"""Rules on one date of a series: whether the network of registrations holds it."""

from __future__ import annotations

from ..evidence import DateEvidence
from .rule import Rule


def _not_readable(evidence: DateEvidence) -> str | None:
    return evidence.failure or None


def _not_linked(evidence: DateEvidence) -> str | None:
    if evidence.failure or (evidence.is_reached and evidence.links):
        return None
    if evidence.links or evidence.rejected:
        return "it is linked with dates only that are left out themselves"
    if not evidence.refusals:
        return "it overlaps no other date enough"
    return f"it could not be registered to any other date: {evidence.reasons()}"


def _open_loops(evidence: DateEvidence) -> str | None:
    if evidence.is_confirmed or not (evidence.rejected or evidence.open_loops):
        return None
    if not evidence.open_loops:
        return f"{evidence.rejected} of its registrations contradict the others"
    return (
        f"{evidence.open_loops} of {evidence.loops} ways around it and two other dates do not "
        "lead back to their start, and no other way confirms it"
    )


def _one_way(evidence: DateEvidence) -> str | None:
    if evidence.is_confirmed or not evidence.is_refused_by_hub:
        return None
    return "the date that all are referred to refuses it, and one way around alone leads to it"


SERIES_RULES: tuple[Rule, ...] = (
    Rule(
        "date not readable",
        "the date's file cannot be opened, or has no place on the series' map",
        "definition of a date",
        "give the date with georeferencing, as a file that GDAL opens",
        _not_readable,
    ),
    Rule(
        "date not linked",
        "no accepted registration connects a date with the reference, or with most other dates",
        "the rules of each registration",
        "see whether it shows the place and is free of clouds; give a larger search radius",
        _not_linked,
    ),
    Rule(
        "loops do not close",
        "loops over a date and two others miss their start by more than the covariances explain "
        "once in 1000 times, or its registrations contradict the network, and no second way "
        "confirms it",
        "[Baarda1968]; suite series",
        "look at the date and its neighbours; give a mask, or leave one of them out",
        _open_loops,
    ),
    Rule(
        "one way alone",
        "the registration of a date to the reference, or to the date with most links, is refused, "
        "and the one way that reaches the date is confirmed by no other",
        "a loop is the only check on such a way",
        "give further dates near to it in time",
        _one_way,
    ),
)
