"""Damaged files end in a result or in one line; what does not is found and kept."""

from __future__ import annotations

import os
import signal
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fuzz
from benchmarks.fuzz import CRASH, ERROR, FAILURES, HANG, OK, TARGETS, TRACEBACK, Target, run_cases
from benchmarks.fuzz_files import write_seeds
from benchmarks.fuzz_mutations import mutate

CASES = 500


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("seeds")
    write_seeds(folder)
    return folder


@pytest.mark.slow
def test_damaged_files_end_in_a_result_or_in_one_line(seeds: Path, tmp_path: Path) -> None:
    found = list(run_cases(range(CASES), seeds, keep=tmp_path))
    assert [case for case in found if case[2] in FAILURES] == []
    assert len(found) == CASES
    assert {target for _, target, _ in found} == set(TARGETS)
    # Neither is all refused nor does damage make no difference.
    outcomes = Counter(outcome for _, _, outcome in found)
    assert min(outcomes[OK], outcomes[ERROR]) > CASES / 10
    assert list(tmp_path.iterdir()) == []


def crash(path: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def hang(path: Path) -> None:
    time.sleep(60)


def fail(path: Path) -> None:
    raise KeyError("a bug")


@pytest.mark.parametrize(
    ("reader", "outcome"), [(crash, CRASH), (hang, HANG), (fail, TRACEBACK), (len, TRACEBACK)]
)
@pytest.mark.slow
def test_what_fails_is_found_and_kept_and_the_next_case_runs(
    reader: Callable[[Path], None],
    outcome: str,
    seeds: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fuzz, "TARGETS", {"broken": Target(("points.csv",), reader)})
    found = list(run_cases(range(2), seeds, ("broken",), tmp_path, patience_s=0.5))
    assert found == [(0, "broken", outcome), (1, "broken", outcome)]
    kept = tmp_path / f"broken-0-{outcome}"
    assert sorted(path.name for path in kept.iterdir()) == ["points.csv", "stderr.txt"]
    if reader is fail:
        assert "KeyError: 'a bug'" in (kept / "stderr.txt").read_text()


def test_a_case_is_the_same_every_time(seeds: Path) -> None:
    names = tuple(TARGETS)
    assert fuzz.Case.of(7, seeds, names) == fuzz.Case.of(7, seeds, names)
    assert fuzz.Case.of(7, seeds, names) != fuzz.Case.of(8, seeds, names)


@pytest.mark.parametrize("is_text", [True, False])
def test_damage_changes_files_mostly(is_text: bool) -> None:
    content = b'{"numbers": [1, 2.5, -3e7], "name": "x"}\n' * 5
    damaged = [mutate(content, np.random.default_rng(i), is_text=is_text) for i in range(100)]
    assert sum(each != content for each in damaged) > 80
    assert len(set(damaged)) > 80
    assert mutate(b"", np.random.default_rng(0), is_text=is_text) == b""
