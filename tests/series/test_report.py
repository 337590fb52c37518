"""The figures of a report on a series."""

from __future__ import annotations

import base64
import datetime
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from affine import Affine
from raster_files import wave_image, write_raster
from rasterio.crs import CRS
from series_dates import FRAME, GRID, shifted

from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, reproject
from groundtie.rasters.pair import Image
from groundtie.rasters.reading import open_raster
from groundtie.registration.evidence import DateEvidence
from groundtie.series.closure import Closure
from groundtie.series.dates import Date
from groundtie.series.frame import SeriesFrame
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
    adjustment = Adjustment(np.zeros((3, 6)), np.zeros((3, 6, 6)), none, 0.05, none)
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


def test_only_with_georeferencing_are_there_metres() -> None:
    found = series(list(DAYS))
    on_pixels = Grid(PIXEL_COORDINATES, None, GRID.width, GRID.height)
    bare = replace(found, frame=SeriesFrame.around(on_pixels, [on_pixels]))
    for one, shift_m in ((found, [20, 10]), (bare, [None, None])):
        row = one.rows()[1]
        assert [row["shift_x_px"], row["shift_y_px"]] == [2, -1]
        assert [row["shift_x_m"], row["shift_y_m"]] == shift_m


def test_metres_are_those_where_the_dates_lie() -> None:
    """At 60° north, where a degree of longitude is half as long, on a hub down to the equator."""
    hub = Grid(Affine(1e-3, 0, 5.0, 0, -1e-3, 60.05), CRS.from_epsg(4326), 1000, 60_000)
    frame = SeriesFrame.around(hub, [hub, *[hub.window(0, 0, 100, 100)] * 3])
    row = replace(series(list(DAYS)), frame=frame).rows()[1]
    # On the ellipsoid, lengths of degrees at 60° are 55 800 m and 111 412 m.
    assert [row["shift_x_m"], row["shift_y_m"]] == pytest.approx([111.6, 111.412], rel=1e-4)


def test_thumbnails_show_the_ground_on_a_map_of_another_crs(tmp_path: Path) -> None:
    """Without a reference the rasters' grid is that of the hub, the frame's that of another."""
    zone_33 = CRS.from_epsg(32633)
    left, top = reproject(GRID.pixel_to_map([[0, 0]]), GRID.crs, zone_33)[0]
    there = Grid(Affine(10, 0, left, 0, -10, top), zone_33, GRID.width, GRID.height)
    path = write_raster(tmp_path / "a.tif", wave_image(GRID, 600.0).astype(np.float32), GRID)
    found = series(list(DAYS))
    with open_raster(path) as source:
        date = Date(found.dates[1].listed, source, Image(source))
        one = replace(found.dates[1], date=date, transform=Transform.nominal(FRAME.grid.crs, GRID))
        dates = (found.dates[0], one, found.dates[2])
        report = SeriesReport.of(replace(found, dates=dates, map_grid=there))
        (shown,) = report.values()["thumbnails"]
    for uri in (shown["nominal"], shown["registered"]):
        data = np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
        assert picture is not None and np.ptp(picture[50:-50, 50:-50].astype(int)) > 200
