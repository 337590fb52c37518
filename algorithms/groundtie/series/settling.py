"""From registrations to dates: the adjusted network, its loops, and the dates left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..rasters.grid import FloatArray
from ..registration.evidence import DateEvidence
from ..registration.verdict import Verdict, decide
from ..wording import counted
from .closure import Closure, triplet_closures
from .frame import SeriesFrame
from .network import Adjustment, Link, adjust
from .pairs import PairResult

Results = Mapping[tuple[int, int], PairResult]


@dataclass(frozen=True)
class DateVerdict(Verdict):
    """Whether a date belongs to the series, and where it lies.

    Parameters
    ----------
    evidence
        The evidence that the verdict rests on.
    displacement, covariance
        From the series' frame to the date's nominal positions, shapes (6,) and (6, 6); None if the
        date is left out.
    worst_loop_px
        Largest error of the loops through the date that close; None: there is none.
    """

    evidence: DateEvidence = field(default_factory=DateEvidence)
    displacement: FloatArray | None = None
    covariance: FloatArray | None = None
    worst_loop_px: float | None = None

    @classmethod
    def of(cls, evidence: DateEvidence, confirmed: str = "") -> DateVerdict:
        """Return the verdict of the rules on a date, without its displacement."""
        return cls(**vars(decide(evidence, confirmed)), evidence=evidence)


@dataclass(frozen=True)
class Settled:
    """A series whose dates are judged.

    Parameters
    ----------
    verdicts
        One verdict for each date.
    closures
        Triplets of dates that stay, without rejected pairs, worst first.
    open_closures
        Triplets, among all dates, that do not close.
    adjustment
        The network of the dates that stay.
    rejected
        Pairs of dates whose registration was accepted, but contradicts the network.
    """

    verdicts: tuple[DateVerdict, ...]
    closures: tuple[Closure, ...]
    open_closures: tuple[Closure, ...]
    adjustment: Adjustment
    rejected: tuple[tuple[int, int], ...]


def settle(frame: SeriesFrame, results: Results, count: int, hub: int, *, is_free: bool) -> Settled:
    """Adjust the network, leave out dates that the rules refuse, and adjust the rest again.

    Parameters
    ----------
    frame
        The series' frame.
    results
        All registrations, by the numbers of reference and input.
    count
        Number of dates.
    hub
        The date that stays where it is.
    is_free
        See `adjust`.
    """
    refused: dict[int, DateVerdict] = {}
    open_closures: dict[tuple[int, ...], Closure] = {}
    rejected: set[tuple[int, int]] = set()
    while True:
        links = [
            result.link(*ends)
            for ends, result in results.items()
            if result.accepted and not refused.keys() & set(ends)
        ]
        found = adjust(frame, links, count, hub, is_free=is_free)
        closures = triplet_closures(frame, links, found.scatter_px)
        network = _AdjustedNetwork(results, links, found, closures, hub)
        open_closures.update({one.dates: one for one in closures if not one.is_closed})
        rejected |= network.rejected
        verdicts = [refused.get(date) or network.verdict(date) for date in range(count)]
        new = {
            date: verdict
            for date, verdict in enumerate(verdicts)
            if not verdict.accepted and date not in refused
        }
        if not new:
            kept = [
                one
                for one in closures
                if not rejected & {(a, b) for a in one.dates for b in one.dates}
            ]
            return Settled(
                tuple(verdicts),
                tuple(kept),
                tuple(open_closures.values()),
                found,
                tuple(sorted(rejected)),
            )
        refused |= new


@dataclass(frozen=True)
class _AdjustedNetwork:
    results: Results
    links: Sequence[Link]
    found: Adjustment
    closures: Sequence[Closure]
    hub: int

    @property
    def rejected(self) -> set[tuple[int, int]]:
        """Pairs whose registration contradicts the others."""
        reached = self.found.reached
        return {
            (link.first, link.second)
            for link, is_kept in zip(self.links, self.found.kept, strict=True)
            if not is_kept and (reached[link.first] or reached[link.second])
        }

    def evidence(self, date: int) -> DateEvidence:
        around = [one for one in self.closures if date in one.dates]
        own = [
            bool(is_kept)
            for link, is_kept in zip(self.links, self.found.kept, strict=True)
            if date in (link.first, link.second)
        ]
        tried = {ends: one for ends, one in self.results.items() if date in ends}
        return DateEvidence(
            "",
            [one.reason for one in tried.values() if not one.accepted],
            sum(own),
            sum(date in ends for ends in self.rejected),
            sum(not one.is_closed for one in around),
            len(around),
            bool(self.found.reached[date]),
            bool(self.found.confirmed[date]),
            # Without a rule it failed, as for too little overlap: nothing speaks against the date.
            any(
                self.hub in ends and not one.accepted and bool(one.rule)
                for ends, one in tried.items()
            ),
        )

    def verdict(self, date: int) -> DateVerdict:
        around = [one.error_px for one in self.closures if date in one.dates and one.is_closed]
        evidence = self.evidence(date)
        reason = _accepted(evidence)
        if date == self.hub:
            verdict = DateVerdict(True, reason, evidence=evidence)
        else:
            verdict = DateVerdict.of(evidence, reason)
        if not verdict.accepted:
            return verdict
        return replace(
            verdict,
            displacement=self.found.displacements[date],
            covariance=self.found.covariances[date],
            worst_loop_px=max(around, default=None),
        )


def _accepted(evidence: DateEvidence) -> str:
    links = counted(evidence.links, "registration")
    if not evidence.is_confirmed:
        return f"{links}, in no loop"
    way = ", reached by other dates" if evidence.is_refused_by_hub else ""
    return f"{links}, confirmed by loops{way}"
