"""A rule, and the advice that rules of several stages give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...masks.used import LITTLE_SHARE

ON_GROUND = "give a mask of the ground, such as roads and waters"
WITHOUT = "give images, or masks, without what is drawn over the ground"

# Condition of rules that need chips with most of their pixels.
UNMASKED = f"unless a ground mask leaves less than {LITTLE_SHARE:.0%}"


@dataclass(frozen=True)
class Rule:
    """A reason to refuse.

    Parameters
    ----------
    name
        Its name in verdicts and in the documentation.
    refuses
        The condition that it refuses, with its limit, for the documentation.
    source
        Where the limit comes from.
    advice
        A safe next step for the user.
    reason
        Returns why it refuses, in a sentence; None: it does not.
    is_final
        Whether nothing else is tried after it. Another mask or matcher cannot mend unsuitable
        images, repetition, overlays or parts that lie elsewhere, but may hide them: noise, copies
        of the reference and seam lines of mosaics passed attempts that followed such refusals
        (once_wrong.txt of the suite attacks).
    """

    name: str
    refuses: str
    source: str
    advice: str
    reason: Callable[[Any], str | None]
    is_final: bool = False
