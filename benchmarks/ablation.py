"""Registrations judged without some of the rules: which results depend on them."""

from __future__ import annotations

from collections.abc import Sequence

from groundtie.registration import verdict
from groundtie.registration.rules import RULES


def leave_out(names: Sequence[str]) -> None:
    """Switch off the rules with these names in this process.

    Raises
    ------
    ValueError
        No rule has one of these names.
    """
    known = {rule.name for rules in RULES.values() for rule in rules}
    for name in names:
        if name not in known:
            raise ValueError(f"no rule {name!r}; there are {'; '.join(sorted(known))}")
    verdict.RULES = {
        stage: tuple(rule for rule in rules if rule.name not in names)
        for stage, rules in RULES.items()
    }


def left_out() -> tuple[str, ...]:
    """Return the names of the rules that are switched off in this process."""
    return tuple(
        rule.name
        for stage, rules in RULES.items()
        for rule in rules
        if rule not in verdict.RULES[stage]
    )
