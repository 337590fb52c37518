"""The verdict: accepted, or refused by a rule, on points that took no part in the fit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import chain
from typing import Any

from ..errors import GroundTieError
from ..geometry.accuracy import UNKNOWN, Accuracy
from ..kinds import plain
from .evidence import AGREEMENT, Evidence, EvidenceOfPoints, SearchEvidence
from .rules import RULES, Rule


@dataclass(frozen=True)
class Verdict:
    """Whether a registration can be trusted.

    For refined RPCs, pixels are those of the image, and the overlap is the whole image.

    Parameters
    ----------
    accepted
        Whether it can be trusted.
    reason
        Why, or why not, in a sentence.
    fit_points, fit_points_used
        How many points the fit had, and how many of them it used.
    check_points, check_points_agreeing
        How many points were held out, and how many of them agree with the model.
    check_rmse_px, check_rmse_m
        Root mean square error of inliers among the check points, in matching pixels, and in
        metres, unless there is no georeferencing.
    log10_chance
        log10 of the probability that random matches would agree as well.
    spread_px
        Standard deviation of the model's predictions over the overlap (root mean square).
    extrapolated_share
        Share of the overlap outside of the hull of the points that were used.
    rule
        Name of the rule that refused it; empty if it is accepted.
    advice
        What a user can try next; empty if it is accepted.
    is_final
        Whether nothing else is tried after it: it is accepted, or refused by a final `Rule`.
    accuracy
        Predicted error of the transform at a random place.
    ce90_m
        CE90 of that error in metres, unless there is no georeferencing.
    """

    accepted: bool
    reason: str
    fit_points: int = 0
    fit_points_used: int = 0
    check_points: int = 0
    check_points_agreeing: int = 0
    check_rmse_px: float = math.nan
    check_rmse_m: float = math.nan
    log10_chance: float = 0.0
    spread_px: float = math.nan
    extrapolated_share: float = math.nan
    rule: str = ""
    advice: str = ""
    is_final: bool = True
    accuracy: Accuracy = UNKNOWN
    ce90_m: float = math.nan

    @property
    def points(self) -> int:
        """How many points the registration rests on: used in the fit, or agreeing with it."""
        return self.fit_points_used + self.check_points_agreeing

    @property
    def chance(self) -> float:
        """Probability that random matches would agree as well (0 where it is too small)."""
        return float(10.0**self.log10_chance)

    def sentence(self) -> str:
        """Return the reason and, of a refusal, what to try."""
        return f"{self.reason}; {self.advice}" if self.advice else self.reason

    @property
    def word(self) -> str:
        """The verdict in a word."""
        return "accepted" if self.accepted else "refused"

    def model_line(self, kind: str) -> str:
        """Return the kind of model and how many points it fits, as a line of text."""
        return f"model: {kind}, {self.fit_points_used} of {self.fit_points} points"

    def error_line(self) -> str:
        """Return the error at check points as a line of text."""
        error = both_units(self.check_rmse_px, self.check_rmse_m)
        return f"error at check points: RMSE {error}"

    def accuracy_line(self) -> str:
        """Return the predicted error at a random place, with its interval, as a line of text."""
        (low, high), ellipse = self.accuracy.ce90_range_px, self.accuracy.ellipse
        ce90 = both_units(self.accuracy.ce90_px, self.ce90_m)
        return (
            f"accuracy at a random place: CE90 {ce90}, known to {low:.2f}–{high:.2f} px; 90 % in "
            f"an ellipse of {ellipse.major_px:.2f} × {ellipse.minor_px:.2f} px, longer "
            f"at {ellipse.angle_deg:.0f}°, of which heights {self.accuracy.heights_px:.2f} px"
        )

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values that JSON can carry; numbers not finite become None."""
        values = asdict(self)
        accuracy = values.pop("accuracy")
        ellipse, (low, high) = accuracy.pop("ellipse"), accuracy.pop("ce90_range_px")
        values |= accuracy | {"points": self.points, "chance": self.chance}
        values |= {"ce90_low_px": low, "ce90_high_px": high}
        values |= {f"ellipse_{name}": value for name, value in ellipse.items()}
        del values["is_final"]
        return dict(plain(values))


def both_units(px: float, metres: float) -> str:
    """Return a length in pixels and, if known, in metres, as text."""
    return f"{px:.2f} px ({metres:.2f} m)" if math.isfinite(metres) else f"{px:.2f} px"


NOT_JUDGED = Verdict(False, "not judged")


def refusals(evidence: Evidence) -> Iterator[tuple[Rule, str]]:
    """Yield the rules of the evidence's stages that refuse, and why; the first of them decides."""
    for rule in chain.from_iterable(RULES[stage] for stage in RULES if stage in evidence.stages):
        reason = rule.reason(evidence)
        if reason is not None:
            yield rule, reason


def decide(evidence: Evidence, confirmed: str = "") -> Verdict:
    """Return the rules' verdict on evidence, without numbers; `confirmed` is why it is accepted."""
    refusal = next(refusals(evidence), None)
    if refusal is None:
        return Verdict(True, confirmed)
    rule, reason = refusal
    return Verdict(False, reason, rule=rule.name, advice=rule.advice, is_final=rule.is_final)


def judge_search(failure: GroundTieError) -> Verdict:
    """Return the verdict on a registration whose search or fit found no transform.

    Raises
    ------
    GroundTieError
        The failure itself, if no rule covers it: it is no refusal, but bad input.
    """
    verdict = decide(SearchEvidence(failure))
    if verdict.accepted:
        raise failure
    return verdict


def judge(evidence: EvidenceOfPoints) -> Verdict:
    """Return the rules' verdict on evidence, with the numbers of its held-out points."""
    points, metres = evidence.held_out, evidence.metres_per_px
    metres = math.nan if metres is None else metres
    verdict = replace(
        decide(evidence, f"{points.name} confirm {evidence.judged}"),
        fit_points=evidence.fit_points,
        fit_points_used=evidence.fit_points_used,
        check_points=points.total,
        check_points_agreeing=points.agreeing,
        log10_chance=points.log10_chance,
    )
    if any(rule.name == verdict.rule for rule in RULES[AGREEMENT]):
        # Errors of matches that may be random measure nothing.
        return verdict
    return replace(
        verdict,
        check_rmse_px=points.rmse_px,
        check_rmse_m=points.rmse_px * metres,
        spread_px=points.spread_px,
        extrapolated_share=evidence.extrapolated_share,
        accuracy=points.accuracy,
        ce90_m=points.accuracy.ce90_px * metres,
    )
