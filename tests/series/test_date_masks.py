"""Masks of dates: what takes no part, and that it stays on its pixels wherever a date is moved."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from raster_files import UTM, utm_grid, write_raster
from series_dates import shifted
from textured_pairs import texture

from groundtie.context import Context
from groundtie.errors import NothingFoundError
from groundtie.rasters.grid import Grid
from groundtie.registration.user_masks import UserMask
from groundtie.series import pairs
from groundtie.series.dates import Date, open_dates
from groundtie.series.frame import SeriesFrame
from groundtie.series.inputs import Listed
from groundtie.series.pairs import PairTask, Settings, register_pair

SIZE = 120
GRID = utm_grid(SIZE, SIZE)
SETTINGS = Settings("auto", 3.0, None, None)

# What the mask hides: the columns from here.
HIDDEN_FROM = 80
SHOWN = np.arange(SIZE)[None, :] < HIDDEN_FROM


def layer_of(path: Path, grid: Grid) -> Path:
    """Write a polygon around the hidden columns."""
    left, right = (grid.pixel_to_map([[col - 0.5, 0]])[0][0] for col in (HIDDEN_FROM, SIZE))
    (top,), (bottom,) = (grid.pixel_to_map([[0, row - 0.5]])[:, 1] for row in (0, SIZE))
    ring = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]
    shape = {"type": "Polygon", "coordinates": [ring]}
    name = f"urn:ogc:def:crs:EPSG::{UTM.to_epsg()}"
    crs = {"type": "name", "properties": {"name": name}}
    feature = {"type": "Feature", "properties": {}, "geometry": shape}
    found = {"type": "FeatureCollection", "crs": crs, "features": [feature]}
    path.write_text(json.dumps(found))
    return path


def raster_of(path: Path, shown: int, hidden: int) -> Path:
    """Write a mask with pixels twice as large."""
    half = SIZE // 2
    values = np.where(np.arange(half)[None, :] < HIDDEN_FROM // 2, shown, hidden)
    values = np.broadcast_to(values, (half, half)).astype(np.uint8)
    return write_raster(path, values, utm_grid(half, half, 20.0))


def masks(folder: Path) -> dict[str, UserMask]:
    return {
        "zeros": UserMask(raster_of(folder / "zeros.tif", 1, 0)),
        "scl": UserMask(raster_of(folder / "scl.tif", 4, 9), "scl"),
        "layer": UserMask(layer_of(folder / "clouds.geojson", GRID), "inside"),
    }


def opened(folder: Path, mask: UserMask | None, stack: ExitStack, context: Context) -> list[Date]:
    listed = []
    for name, one in (("a", None), ("b", mask)):
        path = write_raster(folder / f"{name}.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
        listed.append(Listed(name, path, None, one))
    dates, failures = open_dates(listed, None, stack, context)
    assert not failures
    return dates


@pytest.mark.parametrize("kind", ["zeros", "scl", "layer"])
def test_a_mask_stays_on_its_pixels_where_a_date_is_moved(
    kind: str, tmp_path: Path, one_thread: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []

    def run(opened: Any, *_: Any) -> Any:
        own = opened.pair.input.source.grid
        valid = opened.pair.input.read_onto(own, own.map_to_pixel).valid
        hides = opened.pair.input.mask_hides
        seen.append((own, valid, hides, opened.pair.reference.mask))
        raise NothingFoundError("not looked for")

    monkeypatch.setattr(pairs, "run", run)
    with ExitStack() as stack:
        dates = opened(tmp_path, masks(tmp_path)[kind], stack, one_thread)
        frame = SeriesFrame.around(GRID, [GRID, GRID])
        task = PairTask(dates[0], dates[1], (shifted(0, 0), shifted(9, -7)), SETTINGS, frame)
        result = register_pair(task, one_thread)
    assert result.reason == "not looked for"
    ((grid, valid, hides, other),) = seen
    # Nine columns are ninety metres: the map moved, what is hidden did not.
    assert abs(grid.transform.c - GRID.transform.c) == pytest.approx(90.0)
    # Cubic kernels may leave the border out.
    inner = slice(3, -3)
    np.testing.assert_array_equal(
        valid[inner, inner], np.broadcast_to(SHOWN, valid.shape)[inner, inner]
    )
    assert hides == (kind != "zeros") and other is None


def test_other_values_of_a_mask_are_another_registration(
    tmp_path: Path, one_thread: Context
) -> None:
    path = raster_of(tmp_path / "m.tif", 4, 9)
    keys = set()
    for mask in (None, UserMask(path), UserMask(path, "scl"), UserMask(path, "9")):
        with ExitStack() as stack:
            keys.add(opened(tmp_path, mask, stack, one_thread)[1].key)
    assert len(keys) == 4


def test_a_damaged_mask_costs_its_date_alone(tmp_path: Path, one_thread: Context) -> None:
    (tmp_path / "broken.tif").write_bytes(b"II*\0 no raster")
    path = write_raster(tmp_path / "a.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
    listed = [Listed("a", path, None), Listed("b", path, None, UserMask(tmp_path / "broken.tif"))]
    with ExitStack() as stack:
        dates, failures = open_dates(listed, None, stack, one_thread)
    assert [date.name for date in dates] == ["a"]
    assert "broken.tif" in failures["b"]
