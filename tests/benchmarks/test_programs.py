"""What programs claim is judged; what they do not claim is no error."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmark_scenes import textured_scene

from benchmarks import programs
from benchmarks.accuracy import CORRECT, CRASHED, REFUSED, SILENTLY_WRONG
from benchmarks.attempt import Pair
from benchmarks.offsets import write_offset
from benchmarks.programs import PROGRAMS, Program, Registration, WholeCase, command, error_px
from benchmarks.speed import OWN, PEERS

OFFSET = np.array([12.0, -10.0])
TOY = Program("toy", "toy", "toy.py", ("fast",))


@pytest.fixture
def case(tmp_path: Path) -> WholeCase:
    return WholeCase(textured_scene(tmp_path))


@pytest.fixture
def pair(case: WholeCase, tmp_path: Path) -> Pair:
    return write_offset(case.scene.pair(tmp_path), OFFSET, tmp_path)


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A peer whose script is still to be written; this Python is its environment."""
    monkeypatch.setattr(programs, "peer_python", lambda name: Path(sys.executable))
    monkeypatch.setattr(programs, "PEERS", tmp_path)
    return tmp_path / "toy.py"


def run(case: WholeCase, pair: Pair) -> Registration:
    found = case.register(TOY, pair, 1)
    assert found is not None
    return found


def shift(columns: float, rows: float) -> str:
    return json.dumps([[1, 0, columns], [0, 1, rows]])


@pytest.mark.parametrize(
    ("printed", "verdict", "error"),
    [
        (shift(12, -10), CORRECT, 0.0),
        (shift(12, -9), CORRECT, 1.0),
        (shift(-12, 10), SILENTLY_WRONG, 2 * float(np.hypot(12, 10))),
        ("null", REFUSED, None),
        ("[[NaN, 0, 0], [0, 1, 0]]", REFUSED, None),
    ],
)
def test_a_peers_claim_is_judged(
    case: WholeCase, pair: Pair, toy: Path, printed: str, verdict: str, error: float | None
) -> None:
    toy.write_text(f"print('a word first')\nprint({printed!r})")
    found = run(case, pair)
    assert (found.program, found.name, found.verdict) == ("toy", "texture", verdict)
    assert found.error_px == (None if error is None else pytest.approx(error, abs=1e-6))
    assert found.peak_bytes is not None and found.peak_bytes > 1e6
    assert found.processor_seconds is not None and found.seconds > 0


def test_a_peer_gets_both_files_its_options_and_its_threads(
    case: WholeCase, pair: Pair, toy: Path
) -> None:
    toy.write_text(
        "import os, sys\n"
        f"assert sys.argv[1:] == [{str(pair.reference)!r}, {str(pair.input)!r}, 'fast']\n"
        "assert os.environ['OMP_NUM_THREADS'] == '1'\n"
        f"print('{shift(12, -10)}')"
    )
    assert run(case, pair).verdict == CORRECT


def test_a_peer_that_fails_has_claimed_nothing(case: WholeCase, pair: Pair, toy: Path) -> None:
    toy.write_text("raise SystemExit('does not converge')")
    found = run(case, pair)
    assert (found.verdict, found.error_px, found.peak_bytes) == (REFUSED, None, None)
    assert "does not converge" in found.reason


def test_a_program_that_takes_too_long_is_stopped(
    case: WholeCase, pair: Pair, toy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(programs, "TIME_LIMIT_S", 0.05)
    toy.write_text("while True: pass")
    found = run(case, pair)
    assert (found.verdict, found.reason) == (REFUSED, "time limit")


def test_the_own_failure_is_a_crash(
    case: WholeCase, pair: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(programs, "own_command", lambda pair: [sys.executable, "-c", "1 / 0"])
    found = case.register(None, pair, 1)
    assert found is not None and found.verdict == CRASHED
    assert "ZeroDivisionError" in found.reason


def test_the_own_refusal_is_one(
    case: WholeCase, pair: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = """print('{"verdict": {"accepted": false}}'); raise SystemExit(3)"""
    monkeypatch.setattr(programs, "own_command", lambda pair: [sys.executable, "-c", code])
    found = case.register(None, pair, 1)
    assert found is not None and (found.verdict, found.error_px) == (REFUSED, None)


@pytest.mark.slow
def test_a_pair_is_registered_by_the_command_line_and_by_no_peer_that_is_not_there(
    case: WholeCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(programs, "peer_python", lambda name: None)
    found = case.run(1)
    (own,) = found.records
    assert (own.program, own.verdict) == (OWN, CORRECT)
    assert found.line() == f"texture: {OWN} {CORRECT}"


def test_what_is_not_installed_has_no_command(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "peer_python", lambda name: None)
    assert command(TOY, pair, 1) is None
    assert command(None, pair, 2) is not None


def test_the_last_line_of_output_counts(pair: Pair) -> None:
    output = f"[[1, 2], [3, 4]]\nprogress\n{shift(15, -6)}\n"
    assert error_px(output, pair) == pytest.approx(5.0)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.name)
def test_every_peer_has_a_script_and_is_installed_by_one(program: Program) -> None:
    script = PEERS / program.script
    compile(script.read_text(), str(script), "exec")
    installer = (PEERS.parent / "make_peers_env.sh").read_text()
    assert f"peer {program.environment} " in installer


@pytest.mark.parametrize("code", ["tell(translation((3, -4)))", "tell(None)"])
def test_scripts_print_what_is_read_here(pair: Pair, code: str) -> None:
    words = [sys.executable, "-c", f"from matrices import tell, translation; {code}"]
    done = subprocess.run(words, cwd=PEERS, capture_output=True, text=True, check=True)
    expected = None if "None" in code else pytest.approx(float(np.hypot(9, 6)))
    assert error_px(done.stdout, pair) == expected
