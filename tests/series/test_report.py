"""The figures of a report on a series."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest
from series_dates import FRAME, GRID, shifted

from groundtie.registration.series_evidence import DateEvidence
from groundtie.series.closure import Closure
from groundtie.series.inputs import Listed
from groundtie.series.network import Adjustment
from groundtie.series.report import SeriesReport, closure_figure, shift_figure
from groundtie.series.series import Series, SeriesDate
from groundtie.series.settling import DateVerdict, Settled

DAYS = [datetime.datetime(2020, month, 1) for month in (1, 2, 3)]


def series(times: list[datetime.datetime | None]) -> Series:
    """A series of a reference, a date that stays and one that is left out, without rasters."""
    there, covariance = {"evidence": DateEvidence(links=1)}, 0.01 * np.eye(6)
    verdicts = (
        DateVerdict(True, "", **there, displacement=shifted(0, 0), covariance=0 * covariance),
        DateVerdict(True, "", **there, displacement=shifted(2, -1), covariance=covariance),
        DateVerdict(False, "not linked", rule="date not linked"),
    )
    dates = tuple(
        SeriesDate(Listed(f"date-{k}", Path(f"{k}.tif"), times[k]), verdicts[k], None, None, k == 0)
        for k in range(3)
    )
    none = np.zeros(0, bool)
    adjustment = Adjustment(np.zeros((3, 6)), np.zeros((3, 6, 6)), none, np.zeros(0), 0.05, none)
    closures = (Closure((0, 1, 2), 0.2, 0.1, 4.0, True),)
    open_ = (Closure((0, 1, 2), 3.0, 0.1, 400.0, False),)
    settled = Settled(verdicts, closures, open_, adjustment, ((0, 2),))
    names = tuple(date.name for date in dates)
    return Series(dates, FRAME, GRID, "to date-0", (), settled, names, None, 2, 0, {})


@pytest.mark.parametrize("times", [DAYS, [None, DAYS[1], DAYS[2]]])
def test_shifts_stand_at_their_times_or_in_their_order(times: list[object]) -> None:
    figure = shift_figure(series(times))  # type: ignore[arg-type]
    right, down = figure.axes[0].containers
    np.testing.assert_allclose(right.lines[0].get_ydata(), [0, 2])
    np.testing.assert_allclose(down.lines[0].get_ydata(), [0, -1])
    assert len(set(map(str, right.lines[0].get_xdata()))) == 2


def test_loops_that_do_not_close_stand_apart() -> None:
    figure = closure_figure(series(list(DAYS)))
    marks = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines[:2]}
    assert {label: list(at) for label, at in marks.items()} == {
        "of dates that stay": [0.2],
        "that do not close": [3.0],
    }


def test_the_worst_stands_first() -> None:
    values = SeriesReport.of(series(list(DAYS))).values()
    assert [row["name"] for row in values["rows"]] == ["date-2", "date-1", "date-0"]
    assert values["rejected"] == ["date-0 – date-2"]
    assert (values["registered"], values["count"]) == (1, 2)
