"""Batches of the toy tool: each row's end is its own, and nothing runs twice that need not."""

from __future__ import annotations

import csv
import json
import math
import pickle
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from own_processes import ENVIRONMENT
from toys import TOY, load_toy

from groundtie.batches.batch import Batch
from groundtie.batches.result import BatchResult
from groundtie.batches.running import duration, progress_line
from groundtie.batches.work import DONE, FAILED, REFUSED, Task
from groundtie.declaration import Tool
from groundtie.errors import CancelledError, ParameterError, SameFileError
from groundtie.progress import SILENT, Progress
from groundtie.strict_json import parse_json


class Inline(Executor):
    """Runs tasks as they are submitted, through pickle as if they went to another machine."""

    def __init__(self) -> None:
        self.bytes: list[int] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        packed = pickle.dumps((fn, args, kwargs))
        self.bytes.append(len(packed))
        future: Future[Any] = Future()
        try:
            fn, args, kwargs = pickle.loads(packed)
            future.set_result(pickle.loads(pickle.dumps(fn(*args, **kwargs))))
        except Exception as error:
            future.set_exception(error)
        return future


@pytest.fixture
def table(tmp_path: Path) -> Path:
    for name in ("a.tif", "b.tif"):
        (tmp_path / name).write_bytes(b"raster")
    return tmp_path / "t.json"


def run(
    table: Path,
    *rows: dict[str, Any],
    resume: bool = False,
    executor: Executor | None = None,
    progress: Progress = SILENT,
) -> BatchResult:
    common = {"reference": "a.tif", "input": "b.tif", "size": 3}
    table.write_text(json.dumps({"defaults": common, "rows": rows}))
    folder = table.parent / "out"
    batch = Batch(load_toy, "toy", table, folder, folder / "log.jsonl")
    return batch.run(resume, progress, executor or Inline())


def statuses(result: BatchResult) -> list[str]:
    return [row.outcome.status for row in result.rows]


def test_each_rows_end_is_its_own(table: Path) -> None:
    modes = [{"mode": "refuse"}, {"mode": "crash"}, {"size": 99}, {"name": "good"}]
    result = run(table, *modes)
    assert statuses(result) == [REFUSED, FAILED, FAILED, DONE]
    assert [row.outcome.message for row in result.rows] == [
        "refused: too few points agree",
        "this is a bug in GroundTie: ZeroDivisionError: a bug",
        "size must be 1 to 9 px, not 99",
        "",
    ]
    assert (table.parent / "out/good.tif").read_bytes() == b"done"
    assert "ZeroDivisionError" in result.rows[1].outcome.traceback


@pytest.mark.parametrize(
    ("modes", "code"),
    [(["work"], 0), (["work", "refuse"], 3), (["refuse", "crash", "work"], 2)],
)
def test_the_exit_code_is_that_of_the_worst_row(table: Path, modes: list[str], code: int) -> None:
    assert run(table, *[{"mode": mode} for mode in modes]).exit_code == code


def test_the_summary_is_a_table_and_json(table: Path) -> None:
    result = run(table, {"name": "x"}, {"mode": "refuse"})
    with result.table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["done", "refused"]
    assert rows[0]["check_rmse_px"] == "0.25" and rows[1]["check_rmse_px"] == ""
    assert [row["reason"] for row in rows] == ["good", "too few"]
    assert rows[0]["output"] == str(table.parent / "out/x.tif") and rows[1]["output"] == ""
    details = json.loads(result.details.read_text())
    assert details == json.loads(json.dumps(result.summary()))
    assert (details["done"], details["refused"], details["failed"]) == (1, 1, 0)
    assert details["rows"][1]["result"] == {"verdict": {"accepted": False, "reason": "too few"}}


def test_a_number_that_is_not_finite_costs_no_other_row(
    table: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = {"verdict": {"check_rmse_px": math.nan, "reason": "good", "errors": [1.5, math.inf]}}
    monkeypatch.setattr("toys.ToyResult.summary", lambda _: found)
    result = run(table, {}, {"mode": "refuse"})
    assert statuses(result) == [DONE, REFUSED]
    details = parse_json(result.details.read_bytes())  # strict JSON
    held = {"check_rmse_px": None, "reason": "good", "errors": [1.5, None]}
    assert details["rows"][0]["result"] == {"verdict": held}
    for line in result.log.read_bytes().splitlines():
        parse_json(line)
    with result.table.open(newline="") as file:
        assert [row["check_rmse_px"] for row in csv.DictReader(file)] == ["", ""]


@pytest.mark.parametrize("column", ["name", "title", "output", "mode"])
def test_half_a_character_costs_no_other_row(table: Path, column: str) -> None:
    """JSON may hold it, as a lone surrogate, but no file in UTF-8."""
    result = run(table, {column: "a\udcff", "careful": True}, {"name": "good"})
    assert statuses(result) == [FAILED, DONE]
    rows = json.loads(result.details.read_text(encoding="utf-8"))["rows"]
    assert [row["status"] for row in rows] == [FAILED, DONE] and result.table.exists()


@pytest.mark.parametrize("mode", ["refuse", "crash"])
def test_a_file_of_an_earlier_run_is_no_output(table: Path, mode: str) -> None:
    folder = {"name": "x", "folder": "kept"}
    assert run(table, folder).rows[0].outputs() == {"output": str(table.parent / "out/x.tif")}
    (table.parent / "out/kept").mkdir()
    again = run(table, {**folder, "mode": mode})
    assert (table.parent / "out/x.tif").exists()
    assert again.rows[0].outputs() == {} == again.rows[0].outcome.files


def test_lines_tell_what_did_not_end_well(table: Path) -> None:
    lines = run(table, {}, *[{"mode": "refuse"}] * 22).lines()
    assert lines[0] == "23 rows: 1 done, 22 refused, 0 failed"
    assert lines[1] == "row 2 (02) refused: refused: too few points agree"
    assert lines[-2] == "… and 2 more"
    assert run(table, {}).lines()[0].startswith("1 row: 1 done")


class TestResume:
    def test_what_is_done_or_refused_is_skipped(self, table: Path) -> None:
        first = run(table, {}, {"mode": "refuse"}, {"mode": "crash"})
        executor = Inline()
        second = run(
            table, {}, {"mode": "refuse"}, {"mode": "crash"}, resume=True, executor=executor
        )
        assert len(executor.bytes) == 1
        assert [row.resumed for row in second.rows] == [True, True, False]
        assert [r.outcome.result for r in second.rows] == [r.outcome.result for r in first.rows]
        assert second.exit_code == 2

    def test_without_it_all_rows_run(self, table: Path) -> None:
        run(table, {}, {})
        executor = Inline()
        run(table, {}, {}, executor=executor)
        assert len(executor.bytes) == 2

    def test_rows_keep_their_results_where_they_move_in_the_table(self, table: Path) -> None:
        run(table, {"name": "a"}, {"name": "b"})
        executor = Inline()
        run(table, {"name": "new"}, {"name": "b"}, {"name": "a"}, resume=True, executor=executor)
        assert len(executor.bytes) == 1

    @pytest.mark.parametrize("what", ["input", "output", "parameter", "version", "report"])
    def test_what_changed_runs_again(
        self, table: Path, what: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        run(table, {}, {"size": 4})
        row: dict[str, Any] = {}
        if what == "input":
            (table.parent / "b.tif").write_bytes(b"another")
        elif what == "output":
            (table.parent / "out/1.tif").unlink()
        elif what == "parameter":
            row = {"seed": 3}
        elif what == "report":
            row = {"report": "{name}.html"}
        else:
            monkeypatch.setattr("groundtie.runs.__version__", "9")
        executor = Inline()
        run(table, row, {"size": 4}, resume=True, executor=executor)
        assert len(executor.bytes) == (2 if what in ("input", "version") else 1)

    def test_a_batch_that_was_cancelled_goes_on(self, table: Path) -> None:
        rows = [{"seed": seed} for seed in range(5)]
        asked: list[int] = []

        def cancelled() -> bool:
            asked.append(1)
            return len(asked) > 6  # once before, and twice a row: three rows have ended

        with pytest.raises(CancelledError, match=r"cancelled after 3 of 5 rows; resume"):
            run(table, *rows, progress=Progress(is_cancelled=cancelled))
        executor = Inline()
        result = run(table, *rows, resume=True, executor=executor)
        assert len(executor.bytes) == 2
        assert statuses(result) == [DONE] * 5


def test_a_cancelled_batch_waits_for_no_other_row(table: Path) -> None:
    with ThreadPoolExecutor(1) as executor:
        ended: list[float] = []
        progress = Progress(
            lambda fraction, message: ended.append(fraction), lambda: len(ended) > 1
        )
        with pytest.raises(CancelledError, match="after 1 of 9 rows"):
            run(table, *[{"seed": seed} for seed in range(9)], executor=executor, progress=progress)


def test_a_task_carries_no_pixels(table: Path) -> None:
    (table.parent / "b.tif").write_bytes(bytes(10**6))
    executor = Inline()
    run(table, {}, executor=executor)
    assert max(executor.bytes) < 2000


def test_a_worker_of_another_version_is_told() -> None:
    outcome = Task(load_toy, "toy", {}, (), version="0.0").run()
    assert outcome.status == FAILED
    assert outcome.message.endswith("not 0.0")


def test_a_worker_without_the_package_is_told(table: Path) -> None:
    class Bare(Inline):
        def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.set_exception(ModuleNotFoundError("No module named 'groundtie'"))
            return future

    result = run(table, {}, executor=Bare())
    assert "cannot import what it needs: No module named" in result.rows[0].outcome.message


def test_a_row_that_would_write_the_log_costs_nothing(table: Path) -> None:
    result = run(table, {})
    log = table.parent / "out/1.tif"
    batch = Batch(load_toy, "toy", table, log.parent, log)
    before = [path.read_bytes() for path in (result.table, result.details, log)]
    with pytest.raises(SameFileError, match="the batch and row 1 both write"):
        batch.run(False, SILENT, Inline())
    assert [path.read_bytes() for path in (result.table, result.details, log)] == before


def test_an_unknown_table_costs_no_old_log(table: Path) -> None:
    run(table, {})
    log = table.parent / "out/log.jsonl"
    before = log.read_text()
    with pytest.raises(ParameterError, match="does not know"):
        run(table, {"colour": 1})
    assert log.read_text() == before


def test_progress_tells_how_long_it_takes() -> None:
    # Rows of 30 s each are left: the four that were skipped took no time.
    assert progress_line(Counter([DONE]), 5, 10, 30) == "5 of 10 rows, 2 min left"
    line = progress_line(Counter([DONE, REFUSED]), 6, 10, 60)
    assert line == "6 of 10 rows, 1 refused, 2 min left"


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.2, "0 s"), (89, "89 s"), (120, "2 min"), (7200, "2.0 h")]
)
def test_durations_in_words(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_the_toys_are_tools() -> None:
    assert isinstance(load_toy("toy"), Tool) and load_toy("toy") is TOY


@pytest.mark.slow
def test_a_program_without_a_guard_costs_no_log(table: Path) -> None:
    """The process that reads it anew ends before it touches what the batch has written."""
    table.write_text(json.dumps([{"reference": "a.tif", "input": "b.tif", "size": 3}]))
    script = table.with_name("script.py")
    script.write_text(
        "from pathlib import Path\n"
        "from toys import load_toy\n"
        "from groundtie.batches.batch import Batch\n"
        "from groundtie.progress import SILENT\n"
        f"table = Path({str(table)!r})\n"
        "batch = Batch(load_toy, 'toy', table, table.parent, table.with_name('log'), 1)\n"
        "print(*[row.outcome.message for row in batch.run(False, SILENT).rows])\n"
    )
    done = subprocess.run(
        [sys.executable, script], env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.stdout.count('if __name__ == "__main__":') == 1
    events = [json.loads(line)["event"] for line in table.with_name("log").read_text().splitlines()]
    assert events == ["batch", "row", "end"]
