"""The command line of the benchmarks."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmark_outcomes import outcome

from benchmarks import run
from benchmarks.accuracy import CORRECT, CRASHED, SILENTLY_WRONG
from benchmarks.suites import Settings, SuiteResult

SCRIPT = Path(run.__file__)


@pytest.fixture
def suites(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Settings]]:
    """Suites that keep their settings and find one outcome each: that of `verdicts`."""
    calls: dict[str, list[Settings]] = {}

    def load(name: str) -> SimpleNamespace:
        def suite(settings: Settings) -> SuiteResult:
            calls.setdefault(name, []).append(settings)
            return SuiteResult(name, (), (), [outcome(VERDICTS.get(name, CORRECT)).record()])

        return SimpleNamespace(run=suite)

    monkeypatch.setattr(run, "load_suite", load)
    return calls


VERDICTS = {"crossings": SILENTLY_WRONG, "speed": CRASHED}


@pytest.mark.slow
def test_all_suites_run_by_default(suites: dict[str, list[Settings]], tmp_path: Path) -> None:
    run.main(["--results", str(tmp_path)])
    assert list(suites) == list(run.SUITES)
    written = sorted(path.name for path in tmp_path.iterdir())
    assert written == sorted(f"{name}.{ext}" for name in suites for ext in ("json", "md"))


def test_options_reach_the_suites(suites: dict[str, list[Settings]], tmp_path: Path) -> None:
    options = ["--only", "simulated,real", "--quick", "--seeds", "3", "--jobs", "2"]
    assert run.main([*options, "--results", str(tmp_path)]) == 0
    assert list(suites) == ["simulated", "real"]
    (settings,) = suites["real"]
    assert (settings.quick, settings.seeds, settings.jobs) == (True, 3, 2)
    assert settings.cache.parent == SCRIPT.parent


def test_attacks_are_chosen(suites: dict[str, list[Settings]], tmp_path: Path) -> None:
    names = tmp_path / "names.txt"
    names.write_text("a/-/b/c/1\nparts lie off/-/b/c/2\n")
    options = ["--only", "attacks", "--seeds", "4-6", "--sample", "9", "--results", str(tmp_path)]
    run.main([*options, "--classes", "watermark", "dense city", "--case", f"@{names}"])
    (settings,) = suites["attacks"]
    assert (settings.first_seed, settings.seeds, settings.sample) == (4, 3, 9)
    assert settings.classes == ("watermark", "dense city")
    assert settings.named == ("a/-/b/c/1", "parts lie off/-/b/c/2")
    with pytest.raises(SystemExit):
        run.main(["--seeds", "few"])


def test_a_goal_that_is_missed_is_a_result_and_a_crash_a_failure(
    suites: dict[str, list[Settings]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run.main(["--only", "crossings", "--results", str(tmp_path)]) == 0
    assert run.main(["--only", "real,speed", "--results", str(tmp_path)]) == 1
    assert "1 registrations crashed" in capsys.readouterr().err


def test_unknown_suites_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run.parse(["--only", "real,unreal"])
    assert "no suite 'unreal'" in capsys.readouterr().err


def test_suites_may_be_named_with_hyphens() -> None:
    assert run.parse(["--only", "rpc-city,real"]).only == ("rpc_city", "real")


def test_a_quick_run_says_so() -> None:
    assert "not all" in run.about(run.parse(["--quick"]))["quick"]
    assert run.about(run.parse([]))["quick"] == "no"


@pytest.mark.slow
def test_every_suite_can_be_loaded_when_the_file_is_run() -> None:
    code = (
        f"import importlib, sys; sys.path.insert(0, {str(SCRIPT.parents[1])!r})\n"
        f"for name in {run.SUITES!r}: importlib.import_module(f'benchmarks.{{name}}').run"
    )
    package = str(SCRIPT.parents[1] / "algorithms")
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": package})
    done = subprocess.run([sys.executable, SCRIPT, "--help"], check=True, capture_output=True)
    assert b"--only" in done.stdout
