"""What becomes of a registration that fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from series_dates import FRAME
from textured_pairs import texture

from groundtie.context import Context
from groundtie.errors import (
    GroundTieError,
    MemoryLimitError,
    NoOverlapError,
    NothingFoundError,
    OutputError,
    RasterOpenError,
)
from groundtie.series import pairs
from groundtie.series.dates import open_dates
from groundtie.series.inputs import Listed
from groundtie.series.pairs import PairTask, Settings, pair_key, register_pair

SIZE = 40
SETTINGS = Settings("auto", 3.0, None, None)


@pytest.fixture
def task(tmp_path: Path, one_thread: Context) -> Iterator[PairTask]:
    listed = []
    for name in "ab":
        values = texture(SIZE, SIZE).astype(np.float32)
        path = write_raster(tmp_path / f"{name}.tif", values, utm_grid(SIZE, SIZE))
        listed.append(Listed(name, path, None))
    with ExitStack() as stack:
        (first, second), _ = open_dates(listed, None, stack, one_thread)
        yield PairTask(first, second, (None, None), SETTINGS, FRAME)


@pytest.mark.parametrize("is_elsewhere", [False, True])
@pytest.mark.parametrize(
    ("error", "is_kept"),
    [
        (NothingFoundError, True),
        (NoOverlapError, True),
        (OutputError, False),
        (RasterOpenError, False),
        (MemoryLimitError, False),
    ],
)
def test_what_fails_for_what_may_pass_is_done_again(
    task: PairTask,
    one_thread: Context,
    monkeypatch: pytest.MonkeyPatch,
    error: type[GroundTieError],
    is_kept: bool,
    is_elsewhere: bool,
) -> None:
    def run(*_: Any) -> Any:
        raise error("not now")

    monkeypatch.setattr(pairs, "run", run)
    found = task.elsewhere()() if is_elsewhere else register_pair(task, one_thread)
    key = pair_key(task.first, task.second, SETTINGS, FRAME)
    assert (found.accepted, found.reason) == (False, "not now")
    assert found.key == (key if is_kept else "")


def test_a_date_that_a_worker_cannot_open_may_be_there_later(task: PairTask) -> None:
    elsewhere = task.elsewhere()
    Path(task.second.listed.raster).unlink()
    found = elsewhere()
    assert (found.accepted, found.key) == (False, "") and "b.tif" in found.reason
