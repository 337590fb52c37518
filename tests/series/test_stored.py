"""What a series that does not end leaves."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from raster_files import full_disk
from series_dates import FRAME

from groundtie.errors import OutputError
from groundtie.runs import running
from groundtie.series.pairs import PairResult
from groundtie.series.stored import UNFINISHED, keep_unfinished, read_series

PAIRS = [PairResult("a", other, f"key {other}", False, "a rule", "no") for other in "bcd"]


def test_a_full_disk_keeps_the_registrations_that_fitted(tmp_path: Path) -> None:
    keep = partial(keep_unfinished, tmp_path / "out", None, FRAME)
    with pytest.raises(OutputError), full_disk(0), running("a"):
        keep(PAIRS[0])
    assert not (tmp_path / "out").exists()
    keep(PAIRS[0])
    path = tmp_path / "out" / UNFINISHED
    with pytest.raises(OutputError), full_disk(path.stat().st_size + 50), running("a"):
        keep(PAIRS[1])
    keep(PAIRS[2])
    assert read_series(tmp_path / "out").pairs == {one.key: one for one in (PAIRS[0], PAIRS[2])}
