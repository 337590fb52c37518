"""The log: what is written is found again, and what is torn is left out."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from groundtie.batches.calls import Call
from groundtie.batches.log import open_log, read_finished, still_there
from groundtie.batches.work import DONE, FAILED, REFUSED, Outcome, files_of
from groundtie.errors import OutputError


def written(path: Path, *outcomes: Outcome, append: bool = False) -> None:
    log = open_log(path, append)
    for number, outcome in enumerate(outcomes, 1):
        log.row(Call(number, str(number), key=f"key{number}"), outcome)


def test_rows_that_ended_are_found_by_their_keys(tmp_path: Path) -> None:
    done = Outcome(DONE, "", 1.5, {"a": [1]}, {"c.tif": (3, 4)})
    refused = Outcome(REFUSED, "too few", 2.0, {"verdict": {}})
    written(tmp_path / "log", done, refused, Outcome(FAILED, "no file"))
    assert read_finished(tmp_path / "log") == {"key1": done, "key2": refused}


def test_times_are_rfc_3339(tmp_path: Path) -> None:
    before = datetime.now(UTC).replace(microsecond=0)
    written(tmp_path / "log", Outcome(DONE))
    (line,) = (tmp_path / "log").read_text().splitlines()
    text = json.loads(line)["time"]
    assert text.endswith("Z") and "T" in text
    assert before <= datetime.fromisoformat(text.replace("Z", "+00:00"))


def test_a_torn_line_costs_itself_alone(tmp_path: Path) -> None:
    path = tmp_path / "log"
    written(path, Outcome(DONE, seconds=1))
    with path.open("a") as file:
        file.write('{"event": "row", "key": "key9", "status": "do')
    written(path, Outcome(DONE, seconds=2), Outcome(DONE, seconds=3), append=True)
    found = read_finished(path)
    assert {key: outcome.seconds for key, outcome in found.items()} == {"key1": 2, "key2": 3}


@pytest.mark.parametrize("line", ["[]", "null", '"row"', '{"event": "row", "status": "done"}'])
def test_strange_lines_are_left_out(tmp_path: Path, line: str) -> None:
    (tmp_path / "log").write_text(line + "\n")
    assert read_finished(tmp_path / "log") == {}


def test_a_log_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        open_log(tmp_path, False)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no disk that is full")
@pytest.mark.parametrize("append", [False, True])
def test_a_full_disk_at_the_log_is_one_line(tmp_path: Path, append: bool) -> None:
    path = tmp_path / "log"
    path.symlink_to("/dev/full")
    with pytest.raises(OutputError, match=r"no space left on .*\(writing log\)"):
        written(path, Outcome(DONE), append=append)


def test_files_must_be_as_they_were(tmp_path: Path) -> None:
    path = tmp_path / "c.tif"
    path.write_bytes(b"1234")
    outcome = Outcome(DONE, files=files_of((path, tmp_path)))
    assert set(outcome.files) == {str(path), str(tmp_path)}
    (tmp_path / "other").touch()  # changes the folder's time
    assert still_there(outcome)
    path.write_bytes(b"12345")
    assert not still_there(outcome)
    path.unlink()
    assert not still_there(outcome)
