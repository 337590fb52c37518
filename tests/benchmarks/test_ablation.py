"""Rules that are left out to see what hinges on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from benchmark_outcomes import outcome

from benchmarks.ablation import leave_out, left_out
from benchmarks.attempt import Outcome
from benchmarks.suites import run_cases
from groundtie.errors import NothingFoundError
from groundtie.registration.verdict import judge_search

RULE = "nothing in common"
FOUND_NOTHING = NothingFoundError("nothing found")


@pytest.fixture(autouse=True)
def with_all_rules_again() -> Iterator[None]:
    yield
    leave_out(())


@dataclass(frozen=True)
class Toy:
    """A case that tells which rules are left out where it runs."""

    def run(self, workers: int | None) -> Outcome:
        return outcome(reason=", ".join(left_out()))


def test_what_is_left_out_refuses_nothing() -> None:
    assert judge_search(FOUND_NOTHING).rule == RULE
    leave_out([RULE])
    assert left_out() == (RULE,)
    with pytest.raises(NothingFoundError):
        judge_search(FOUND_NOTHING)


def test_there_must_be_such_a_rule() -> None:
    with pytest.raises(ValueError, match="no rule 'no such rule'; there are"):
        leave_out(["no such rule"])
    assert left_out() == ()


@pytest.mark.slow
def test_workers_leave_it_out_too() -> None:
    leave_out([RULE])
    assert {o.reason for o in run_cases([Toy(), Toy()], 2, lambda line: None)} == {RULE}
