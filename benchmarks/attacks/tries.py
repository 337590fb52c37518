"""The outcome of one attack, and the call of a tool."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from groundtie.errors import GroundTieError, NotRegisteredError
from groundtie.kinds import plain

from ..accuracy import CRASHED, REFUSED

ACCEPTED = "accepted"


@dataclass(frozen=True)
class AttackOutcome:
    """The outcome of one attack.

    Parameters
    ----------
    name, group, attack, variant, scene, kind, tool, seed
        The case.
    verdict
        One of `accuracy.VERDICTS`; `ACCEPTED` until it is judged.
    sigma_px
        Uncertainty of the truth.
    error_px, rmse_px
        The 90 % quantile of the errors, and their root mean square; NaN if refused.
    claimed_ce90_px
        The tool's own estimate of the former.
    rule, reason
        The rule that refused, and the tool's message.
    note
        The random choices.
    seconds
        Wall-clock time of the call.
    """

    name: str
    group: str
    attack: str
    variant: str
    scene: str
    kind: str
    tool: str
    seed: int
    verdict: str
    sigma_px: float
    error_px: float
    rmse_px: float
    claimed_ce90_px: float
    rule: str
    reason: str
    note: str
    seconds: float

    def record(self) -> dict[str, Any]:
        """Return the outcome as JSON-compatible values."""
        return plain(asdict(self))

    def line(self) -> str:
        """Return the outcome as a line of text."""
        error = "" if math.isnan(self.error_px) else f" {self.error_px:.2f} px"
        why = self.rule or self.reason
        return f"{self.name}: {self.verdict}{error} in {self.seconds:.1f} s; {why}; {self.note}"


class Named(Protocol):
    """The names that identify a case."""

    @property
    def name(self) -> str: ...
    @property
    def group(self) -> str: ...
    @property
    def attack(self) -> str: ...
    @property
    def variant(self) -> str: ...
    @property
    def scene(self) -> str: ...
    @property
    def tool(self) -> str: ...
    @property
    def seed(self) -> int: ...


def attempted(
    case: Named, kind: str, sigma_px: float, note: str, call: Callable[[], Any]
) -> tuple[Any, AttackOutcome]:
    """Call a tool; return its result (None: it has none), and the outcome before it is judged.

    Parameters
    ----------
    case
        The case to try.
    kind, sigma_px, note
        Of the case's pair.
    call
        Calls the tool.
    """
    started = time.perf_counter()
    result, verdict, rule = None, ACCEPTED, ""
    try:
        result = call()
        reason = result.summary()["verdict"]["reason"]
    except NotRegisteredError as refusal:
        verdict, judged = REFUSED, refusal.verdict
        rule, reason = ("", str(refusal)) if judged is None else (judged.rule, judged.reason)
    except GroundTieError as error:
        # Bad input, reported in one line.
        verdict, rule, reason = REFUSED, "bad input", str(error)
    except Exception as error:
        # A crash is a finding, too: it is counted, and `run.py` exits with 1.
        traceback.print_exc()
        verdict, reason = CRASHED, repr(error)
    return result, AttackOutcome(
        case.name,
        case.group,
        case.attack,
        case.variant,
        case.scene,
        kind,
        case.tool,
        case.seed,
        verdict,
        sigma_px,
        math.nan,
        math.nan,
        math.nan,
        rule,
        reason,
        note,
        time.perf_counter() - started,
    )
