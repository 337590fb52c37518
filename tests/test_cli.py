"""The command line, made from declarations: a toy tool, and what all tools share."""

from __future__ import annotations

import dataclasses
import errno
import io
import json
import logging
import os
import pty
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import click
import pytest
import toys
from own_processes import ENVIRONMENT, interrupted, read_until
from toys import TOY, run_tools

from groundtie.cli import main
from groundtie.errors import ParameterError
from groundtie.tools import NAMES, load_tool, named_tool
from groundtie.version import __version__


@pytest.fixture(autouse=True)
def _surroundings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Run in an empty folder, and undo what the command line does to its process."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CPL_LOG", os.devnull)
    monkeypatch.setenv("OPENCV_LOG_LEVEL", "ERROR")
    handlers = list(logging.getLogger().handlers)
    with warnings.catch_warnings():
        yield
    logging.getLogger().handlers[:] = handlers


def run(words: str) -> int:
    return run_tools(words.split(), [TOY])


GOOD = "toy a.tif b.tif c.tif --size 3"


def test_a_run_prints_the_result_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(GOOD) == 0
    assert capsys.readouterr() == ("accepted\nsize 3.0\n", "")
    assert Path("c.tif").read_bytes() == b"done"


def test_a_tool_is_also_found_by_its_name_in_python(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["match_sar_sar", "--help"]) == 0
    assert "Register a SAR image to another one" in capsys.readouterr().out


def test_json_is_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    options = "--search-radius 4 --mode work --no-careful --title words --tie-points t.gpkg"
    assert run(f"{GOOD} {options} --folder out --regions r.gpkg --seed 9 --json") == 0
    out, err = capsys.readouterr()
    assert err == ""
    values = json.loads(out)["values"]
    assert values == {
        "reference": "a.tif",
        "input": "b.tif",
        "output": "c.tif",
        "size": 3.0,
        "search_radius": 4.0,
        "band": 1,
        "careful": False,
        "title": "words",
        "tie_points": "t.gpkg",
        "report": None,
        "folder": "out",
        "regions": "r.gpkg",
        "transform": None,
        "mask": None,
        "others": None,
        "seed": 9,
    }


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("toy a.tif b.tif --size 3", r"Missing argument 'OUTPUT' \(see groundtie toy --help\)"),
        ("toy a.tif b.tif c.tif", r"(Missing option '--size' \(see.*\)|--size is missing)"),
        (f"{GOOD} d.tif", r"Got unexpected extra argument \(d.tif\) \(see groundtie toy --help\)"),
        (f"{GOOD} --speed 3", r"No such option:? '?--speed'?.* \(see groundtie toy --help\)"),
        (f"{GOOD} --seed", r"Option '--seed' requires an argument.*"),
        ("fly", r"No such command 'fly' \(see groundtie --help\)"),
        (f"{GOOD} --seed 1.5", "--seed must be a whole number, not 1.5"),
        (f"{GOOD} --size 10", "--size must be 1 to 9 px, not 10"),
        (f"{GOOD} --search-radius -1", "--search-radius must be at least 0 m, not -1"),
        (f"{GOOD} --mode fly", "--mode must be one of work, refuse, crash, wait, not 'fly'"),
        (f"{GOOD} --report r.pdf", "--report must end in .html: r.pdf"),
        ("toy a.tif a.tif c.tif --size 3", "INPUT is the same raster as REFERENCE: a.tif"),
        ("toy a.tif b.tif a.tif --size 3", "OUTPUT is the same file as REFERENCE: a.tif"),
        ("toy a.tif b.tif no/c.tif --size 3", "the folder of OUTPUT does not exist: .*/no"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    words: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(f"groundtie: error: {message}\n", err)
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize(
    ("raised", "shown"),
    [
        ("give tie_points or a reference", "give --tie-points or a reference"),
        (
            "a start (transform) needs search_radius.",
            "a start (--transform) needs --search-radius.",
        ),
        ("size, not 'search_radius'", "size, not 'search_radius'"),
        ("no file a/tie_points.gpkg", "no file a/tie_points.gpkg"),
        ("no file tie_points/a.gpkg", "no file tie_points/a.gpkg"),
    ],
)
def test_errors_of_a_tool_spell_parameters_as_options(
    raised: str, shown: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(**values: Any) -> Any:
        raise ParameterError(raised)

    assert run_tools(GOOD.split(), [dataclasses.replace(TOY, run=fail)]) == 2
    assert capsys.readouterr().err == f"groundtie: error: {shown}\n"


def test_a_refusal_is_one_line_and_exit_code_3(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(f"{GOOD} --mode refuse") == 3
    assert capsys.readouterr() == ("", "groundtie: error: refused: too few points agree\n")
    assert not Path("c.tif").exists()


def test_a_refusal_tells_its_verdict_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(f"{GOOD} --mode refuse --json") == 3
    out, err = capsys.readouterr()
    assert json.loads(out) == {"verdict": {"accepted": False, "reason": "too few"}}
    assert err == "groundtie: error: refused: too few points agree\n"


def test_a_bug_keeps_its_traceback() -> None:
    with pytest.raises(ZeroDivisionError, match="a bug"):
        run(f"{GOOD} --mode crash")


def test_a_number_that_json_does_not_know_is_a_bug(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(toys.ToyResult, "summary", lambda self: {"error": float("nan")})
    with pytest.raises(ValueError, match="JSON"):
        run(f"{GOOD} --json")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a disk that is full, in Linux")
@pytest.mark.parametrize("words", [GOOD, f"{GOOD} --json", ""])
@pytest.mark.parametrize("unbuffered", ["1", ""])
def test_a_full_disk_behind_standard_output_is_one_line(words: str, unbuffered: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, toys.__file__, *words.split()],
            env={**ENVIRONMENT, "PYTHONUNBUFFERED": unbuffered},
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    reason = os.strerror(errno.ENOSPC)
    assert done.stderr == f"groundtie: error: cannot write to standard output: {reason}\n"
    assert done.returncode == 2


@pytest.mark.parametrize("closed", ["1", "2"])
@pytest.mark.parametrize("option", ["", "-v", "--quiet"])
def test_a_closed_stream_costs_no_result(closed: str, option: str) -> None:
    before, after = (option, "") if option == "-v" else ("", option)
    words = [sys.executable, toys.__file__, *f"{before} {GOOD} {after}".split()]
    command = ["sh", "-c", f'exec "$@" {closed}>&-', "sh", *words]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert (done.returncode, Path("c.tif").read_bytes()) == (0, b"done")
    assert done.stdout == ("" if closed == "1" else "accepted\nsize 3.0\n")


def test_an_error_where_standard_error_is_closed_has_its_exit_code() -> None:
    words = [sys.executable, toys.__file__, *GOOD.split(), "--mode", "refuse"]
    command = ["sh", "-c", 'exec "$@" 2>&-', "sh", *words]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (3, b"")


NUMBERING = f"""
import dataclasses, os, sys
import toys

def run(**values):
    with open("first", "w") as first:
        print(first.fileno() > 2, *map(os.get_inheritable, range(3)), file=first)
    return toys.toy(**values)

sys.exit(toys.run_tools({GOOD.split()!r}, [dataclasses.replace(toys.TOY, run=run)]))
"""


@pytest.mark.parametrize("closed", ["<&- 2>&-", "<&- >&- 2>&-"])
def test_no_file_gets_the_number_of_a_closed_stream(closed: str) -> None:
    """Libraries would write their messages into it."""
    command = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-c", NUMBERING]
    assert subprocess.run(command, env=ENVIRONMENT, check=False).returncode == 0
    assert Path("first").read_text() == "True True True True\n"


@pytest.mark.parametrize("name", ["stdout", "stderr"])
@pytest.mark.parametrize("end", ["close", "detach"])
def test_python_may_have_closed_its_streams(
    name: str, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = io.TextIOWrapper(io.BytesIO())
    getattr(stream, end)()
    monkeypatch.setattr(sys, name, stream)
    assert run(GOOD) == 0
    assert run(f"{GOOD} --mode refuse") == 3
    assert getattr(sys, name) is stream


def test_python_has_its_streams_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.BytesIO()
    stream = io.TextIOWrapper(written, encoding="latin-1", errors="replace")
    monkeypatch.setattr(sys, "stdout", stream)
    assert run_tools([*GOOD.split(), "--title", "1–2"], [TOY]) == 0
    assert written.getvalue() == b"accepted\nsize 3.0\n1\\u20132\n"
    assert (sys.stdout, stream.errors) == (stream, "replace")


def test_signs_that_the_terminal_does_not_have_cost_no_result() -> None:
    words = [sys.executable, toys.__file__, *GOOD.split(), "--title", "1–2 µm"]
    environment = {**ENVIRONMENT, "PYTHONIOENCODING": "latin-1"}
    run = subprocess.run(words, env=environment, capture_output=True, check=False)
    assert (run.returncode, run.stderr) == (0, b"")
    assert run.stdout == b"accepted\nsize 3.0\n1\\u20132 \xb5m\n"


def test_help_lists_the_tools(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    out = capsys.readouterr().out
    assert re.search(r"^  toy +Do what a tool does, without images\.$", out, re.MULTILINE)
    assert run("") == 0
    assert capsys.readouterr().out == out


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--version") == 0
    assert capsys.readouterr() == (f"groundtie {__version__}\n", "")


@pytest.mark.parametrize("option", ["--version", "--help"])
def test_the_command_starts_without_loading_the_tools(option: str) -> None:
    code = (
        f"import sys; from groundtie.cli import main; main(['{option}']); "
        "sys.exit(bool({'numpy', 'rasterio', 'cv2'} & set(sys.modules)))"
    )
    subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, check=True, capture_output=True)


@pytest.mark.parametrize("name", NAMES)
def test_what_lists_of_tools_show_is_what_is_declared(name: str) -> None:
    named, tool = named_tool(name), load_tool(name)
    declared = (name, tool.title, tool.group, tool.summary)
    assert (named.name, named.title, named.group, named.summary) == declared


def test_help_of_a_tool_tells_everything_of_its_parameters(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run("toy --help") == 0
    out = capsys.readouterr().out
    usage, arguments, options, advanced = re.split(r"(?m)^\w[\w ]*:\n", out)
    assert usage.startswith("Usage: groundtie toy [OPTIONS] REFERENCE INPUT OUTPUT\n")
    assert "It writes its output only at the end, as all tools do." in usage
    assert re.search(r"REFERENCE +The raster that stays\.\n", arguments)
    rows = re.sub(r"\s+", " ", options)
    assert "--size NUMBER How large. [px; 1 to 9; required]" in rows
    assert "--search-radius NUMBER How far; by default from the data. [m; at least 0]" in rows
    assert "--mode [work|refuse|crash|wait] What it does. [default: work]" in rows
    assert "--band BAND Which band. [default: 1]" in rows
    assert "--careful / --no-careful Look twice. [default: yes]" in rows
    assert "--report FILE For people." in rows
    assert "--folder FOLDER For more files." in rows
    assert "--json" in rows
    assert "--quiet" in rows
    assert "--seed" not in rows
    assert "--seed INTEGER For chance. [at least 0; default: 7]" in re.sub(r"\s+", " ", advanced)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("groundtie t", ["plain,toy"]),
        ("groundtie u", []),
        ("groundtie --vers", ["plain,--version"]),
        ("groundtie toy --mo", ["plain,--mode"]),
        ("groundtie toy --mode r", ["plain,refuse"]),
        ("groundtie toy a", ["file,a"]),
        ("groundtie toy --folder a", ["dir,a"]),
        ("groundtie toy --others a", ["file,a"]),
        ("groundtie toy --size 1", []),
        ("groundtie coregister-series out a b", ["file,b"]),
    ],
)
def test_the_shell_completes_commands_options_words_and_files(
    words: str,
    expected: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("_GROUNDTIE_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    with pytest.raises(SystemExit) as ended:
        run_tools([], [TOY, load_tool("coregister_series")])
    assert ended.value.code == 0
    assert capsys.readouterr().out.split() == expected


def test_completing_a_command_loads_no_tool() -> None:
    code = (
        "import sys; from groundtie.cli import main\n"
        "try: main([])\n"
        "except SystemExit: sys.exit(bool({'numpy', 'rasterio', 'cv2'} & set(sys.modules)))"
    )
    words = {"COMP_WORDS": "groundtie co", "COMP_CWORD": "1"}
    environment = {**ENVIRONMENT, "_GROUNDTIE_COMPLETE": "bash_complete", **words}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["plain,coregister", "plain,coregister-series"]


def start(words: str, stderr: int = subprocess.PIPE) -> subprocess.Popen[str]:
    """Start the toy tool in a process of its own."""
    return subprocess.Popen(
        [sys.executable, toys.__file__, *words.split()],
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_cancels_in_one_line_and_leaves_nothing(number: signal.Signals) -> None:
    command = [sys.executable, toys.__file__, *GOOD.split(), "--mode", "wait"]
    code, out, rest = interrupted(command, "half of it\x1b[K", number)  # the tool is at work
    assert (code, out) == (128 + number, "")
    assert rest == "\r\x1b[Kgroundtie: error: cancelled; nothing was written\r\n"
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("started", [True, False])
def test_a_second_signal_ends_in_one_line_what_takes_no_notice_of_the_first(
    number: signal.Signals,
    started: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def busy(*_: Any, **__: Any) -> Any:
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)
        time.sleep(60)

    if not started:
        monkeypatch.setattr(click.Group, "parse_args", busy)
    assert run_tools(GOOD.split(), [dataclasses.replace(TOY, run=busy)]) == 128 + number
    assert capsys.readouterr() == ("", "groundtie: error: cancelled\n")


def test_progress_is_for_terminals() -> None:
    out, err = start(GOOD).communicate(timeout=60)
    assert (out, err) == ("accepted\nsize 3.0\n", "")


def test_quiet_shows_no_progress_on_a_terminal() -> None:
    shown = {}
    for option in ("", "--quiet"):
        primary, secondary = pty.openpty()
        start(f"{GOOD} {option}", stderr=secondary).communicate(timeout=60)
        os.write(secondary, b".")  # so that there is something to read
        shown[option] = read_until(primary, ".")
        os.close(secondary)
        os.close(primary)
    assert shown["--quiet"] == "."
    assert (
        shown[""]
        == "\r 50% half of it\x1b[K\r100% half of it\x1b[K\r100% half of it\x1b[K\r\x1b[K."
    )


def test_verbose_writes_the_log_and_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(f"-v {GOOD}") == 0
    assert capsys.readouterr() == ("accepted\nsize 3.0\n", "groundtie.progress: half of it\n")
    Path("c.tif").unlink()
    assert run(GOOD) == 0
    assert capsys.readouterr() == ("accepted\nsize 3.0\n", "")


@pytest.mark.parametrize(
    ("words", "workers"),
    [
        (GOOD, None),
        (f"--workers 3 {GOOD}", 3),
        (f"{GOOD} --workers 3", 3),
        (f"--workers 3 {GOOD} --workers 4", 4),
    ],
)
def test_workers_stand_before_or_after_the_tools_name(words: str, workers: int | None) -> None:
    seen: list[Any] = []

    def noting(**values: Any) -> Any:
        seen.append(values["workers"])
        return TOY.run(**values)

    assert run_tools(words.split(), [dataclasses.replace(TOY, run=noting)]) == 0
    assert seen == [workers]


@pytest.mark.parametrize("words", [f"--workers 10 {GOOD}", f"{GOOD} --workers 10"])
def test_workers_that_cannot_be_are_one_line(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) == 2
    assert capsys.readouterr().err == "groundtie: error: --workers must be 1 to 9, not 10\n"


@pytest.mark.slow
def test_a_tool_without_workers_ignores_those_before_its_name() -> None:
    assert main(["--workers", "2", "doctor", "--json"]) == 0


NOISY = f"""
import ctypes, dataclasses, logging, re, sys, warnings
import rasterio, toys

def run(**values):
    warnings.warn("noise")
    logging.getLogger("rasterio._env").warning("noise")
    libraries = set(re.findall(r"/\\S+libgdal\\S+", open("/proc/self/maps").read()))
    for library in libraries:  # as GDAL speaks in a thread of which rasterio does not know
        ctypes.CDLL(library).CPLError(2, 1, b"noise of GDAL")
    return toys.toy(**{{**values, "title": str(len(libraries))}})

tool = dataclasses.replace(toys.TOY, run=run)
sys.exit(toys.run_tools({[*GOOD.split(), "--json"]!r}, [tool]))
"""


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="finds GDAL in Linux's /proc")
@pytest.mark.slow
def test_libraries_are_silent() -> None:
    quiet = {k: v for k, v in ENVIRONMENT.items() if k not in ("CPL_LOG", "PYTHONWARNINGS")}
    done = subprocess.run(
        [sys.executable, "-c", NOISY], env=quiet, text=True, capture_output=True, check=True
    )
    assert json.loads(done.stdout)["values"]["title"] == "1"
    assert done.stderr == ""


def test_who_asks_for_warnings_gets_them() -> None:
    loud = {**ENVIRONMENT, "PYTHONWARNINGS": "always"}
    done = subprocess.run(
        [sys.executable, "-c", NOISY], env=loud, text=True, capture_output=True, check=True
    )
    assert "UserWarning: noise" in done.stderr
