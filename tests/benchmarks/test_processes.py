"""Time and memory of whole processes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import processes
from benchmarks.processes import OUTPUT, Measured, measure, measure_often


def python(code: str, *arguments: str) -> list[str]:
    return [sys.executable, "-c", code, *arguments]


def test_the_output_of_a_command_comes_back() -> None:
    found = measure(python("print('a result')"))
    assert (found.output.strip(), found.exit_code) == ("a result", 0)


@pytest.mark.slow
def test_peak_memory_is_that_of_the_command() -> None:
    megabytes = 200
    small = measure(python("pass"))
    large = measure(python(f"b = b'x' * ({megabytes} << 20)"))
    assert large.peak_bytes - small.peak_bytes == pytest.approx(megabytes << 20, rel=0.1)


@pytest.mark.slow
def test_the_memory_of_this_process_does_not_count() -> None:
    ballast = np.ones(40_000_000)  # 320 MB
    assert measure(python("pass")).peak_bytes < ballast.nbytes / 4


def test_processor_time_is_no_longer_than_the_run_of_one_thread() -> None:
    found = measure(python("sum(range(10**6))"))
    assert found.processor_seconds > 0
    assert found.seconds > 0


def test_the_package_can_be_imported_by_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    found = measure(python("import groundtie; print(groundtie.__file__)"))
    assert Path(found.output.strip()) == processes._PACKAGE / "groundtie" / "__init__.py"


def test_the_command_keeps_what_it_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    found = measure(python("import sys; print(sys.dont_write_bytecode)"))
    assert found.output.strip() == "False"


def test_output_stands_for_a_new_file_that_is_thrown_away() -> None:
    code = "import sys; open(sys.argv[1], 'x').close(); print(sys.argv[1])"
    paths = [measure(python(code, OUTPUT)).output.strip() for _ in range(2)]
    assert not any(Path(path).exists() for path in paths)
    assert all(path.endswith(".tif") for path in paths)


def test_a_refusal_is_no_failure() -> None:
    assert measure(python("raise SystemExit(3)")).exit_code == 3


def test_a_failure_is_told_with_what_was_said() -> None:
    with pytest.raises(RuntimeError, match="what went wrong"):
        measure(python("raise SystemExit('what went wrong')"))


@pytest.mark.parametrize(("seconds", "expected"), [([3, 1, 2], 2), ([5], 5), ([4, 1], 1)])
def test_the_median_run_is_taken(
    monkeypatch: pytest.MonkeyPatch, seconds: list[float], expected: float
) -> None:
    runs = iter([Measured(s, s, 0, 0, "") for s in seconds])
    monkeypatch.setattr(processes, "measure", lambda command: next(runs))
    assert measure_often(["command"], len(seconds)).seconds == expected
