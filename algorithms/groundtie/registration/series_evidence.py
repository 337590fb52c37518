"""What is known of one date of a series: how the network of registrations reaches it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from .evidence import SERIES


@dataclass(frozen=True)
class DateEvidence:
    """How a date is connected with its series.

    Parameters
    ----------
    failure
        Why its file cannot be used; empty: it can.
    refusals
        Why registrations to other dates were refused, one each.
    links
        How many registrations to other dates were accepted, and are used.
    rejected
        How many were accepted, but contradict the rest of the network.
    open_loops, loops
        How many ways around it and two other dates do not lead back, and how many there are.
    is_reached
        Whether links lead to it from the reference, or from most of the other dates.
    is_confirmed
        Whether a second way leads to it.
    is_refused_by_hub
        Whether its registration to the reference, or to the date that most are linked with, was
        refused.
    """

    failure: str = ""
    refusals: Sequence[str] = ()
    links: int = 0
    rejected: int = 0
    open_loops: int = 0
    loops: int = 0
    is_reached: bool = True
    is_confirmed: bool = False
    is_refused_by_hub: bool = False

    stages: ClassVar = (SERIES,)

    def reasons(self) -> str:
        """Return why registrations were refused, the most frequent reason first."""
        counted = Counter(self.refusals).most_common(2)
        return "; ".join(f"{reason} ({count} of {len(self.refusals)})" for reason, count in counted)
