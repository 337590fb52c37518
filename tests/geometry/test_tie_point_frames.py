from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from raster_files import UTM, utm_grid

from groundtie.geometry.tie_point_files import write_tie_points
from groundtie.geometry.tie_point_frames import tie_point_columns, tie_point_geodataframe
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform

TRANSFORM = Transform.nominal(UTM, utm_grid(100, 100))


@pytest.fixture
def points() -> TiePoints:
    rng = np.random.default_rng(0)
    px = rng.uniform(0, 99, (6, 2))
    return TiePoints(
        reference_xy=TRANSFORM.input_grid.pixel_to_map(px) + [10, 0],
        input_px=px,
        score=np.arange(6.0),
        covariance_px2=np.tile(np.diag([0.25, 4.0]), (6, 1, 1)),
        forward_backward_error_px=np.zeros(6),
        is_check=np.arange(6) % 2 == 0,
        state=np.array(["used", "rejected: far"] * 3),
    )


def test_columns_are_arrays(points: TiePoints) -> None:
    columns = tie_point_columns(points, TRANSFORM)
    assert {column.shape for column in columns.values()} == {(6,)}
    np.testing.assert_array_equal(columns["reference_x"], points.reference_xy[:, 0])
    np.testing.assert_allclose(columns["dx_px"], -1, atol=1e-6)
    np.testing.assert_allclose(columns["residual_px"], 1, atol=1e-6)
    np.testing.assert_array_equal(columns["sigma_x_px"], 0.5)
    np.testing.assert_array_equal(columns["sigma_y_px"], 2.0)
    assert columns["role"].tolist() == ["check", "fit"] * 3
    assert columns["state"].tolist() == ["used", "rejected: far"] * 3


def test_columns_are_those_of_files(points: TiePoints, tmp_path: Path) -> None:
    write_tie_points(tmp_path / "points.csv", points, TRANSFORM)
    with (tmp_path / "points.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    columns = tie_point_columns(points, TRANSFORM)
    assert [*columns, "reference_crs"] == list(rows[0])
    for name, column in columns.items():
        assert [str(value) for value in column.tolist()] == [row[name] for row in rows]


def test_without_points_there_are_columns_still(points: TiePoints) -> None:
    columns = tie_point_columns(points.take([]), TRANSFORM)
    assert {column.shape for column in columns.values()} == {(0,)}


def test_a_geodataframe_lies_on_the_map(points: TiePoints) -> None:
    pytest.importorskip("geopandas")
    frame = tie_point_geodataframe(points, TRANSFORM)
    assert frame.crs == "EPSG:32632"
    np.testing.assert_array_equal(frame.geometry.x, points.reference_xy[:, 0])
    np.testing.assert_array_equal(frame[frame.role == "check"].score, [0, 2, 4])


def test_without_geopandas_the_error_names_the_extra(
    points: TiePoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "geopandas", None)
    with pytest.raises(ImportError, match=r"pip install 'groundtie\[geopandas\]'"):
        tie_point_geodataframe(points, TRANSFORM)
