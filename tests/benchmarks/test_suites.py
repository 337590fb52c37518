"""Cases run one after the other or side by side, with the same outcomes in the same order."""

from __future__ import annotations

import os
from dataclasses import dataclass

import cv2
import pytest
from benchmark_outcomes import outcome

from benchmarks.attempt import Outcome
from benchmarks.suites import run_cases


@dataclass(frozen=True)
class Toy:
    """A case that says where and how it ran."""

    name: str

    def run(self, workers: int | None) -> Outcome:
        return outcome(
            name=self.name, model=str(workers), reason=f"{os.getpid()} {cv2.getNumThreads()}"
        )


@dataclass(frozen=True)
class Broken:
    """A case that is itself wrong."""

    def run(self, workers: int | None) -> Outcome:
        raise LookupError("no such file")


CASES = [Toy(name) for name in "abcde"]


def test_one_job_runs_here_with_all_threads() -> None:
    lines: list[str] = []
    found = run_cases(CASES, 1, lines.append)
    assert [o.name for o in found] == list("abcde")
    assert {o.model for o in found} == {"None"}
    assert {o.reason.split()[0] for o in found} == {str(os.getpid())}
    assert [line.split("]")[0] for line in lines] == [f"[{n}/5" for n in range(1, 6)]


@pytest.mark.slow
def test_several_jobs_run_elsewhere_with_one_thread_each() -> None:
    lines: list[str] = []
    found = run_cases(CASES, 2, lines.append)
    assert [o.name for o in found] == list("abcde")
    assert {o.model for o in found} == {"1"}
    assert str(os.getpid()) not in {o.reason.split()[0] for o in found}
    assert {o.reason.split()[1] for o in found} == {"1"}
    assert len(lines) == 5


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_case_that_is_itself_wrong_stops_the_suite(jobs: int) -> None:
    with pytest.raises(LookupError, match="no such file"):
        run_cases([Broken()], jobs, lambda line: None)


def test_no_cases_have_no_outcomes() -> None:
    assert run_cases([], 1) == []
