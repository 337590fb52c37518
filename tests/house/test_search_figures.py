"""Figures on the search, which the oldest and the newest packages must be able to draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from groundtie.tools.simulate import simulate
from scripts import search_figures

POINTS = (
    "reference_x,reference_y,input_col,input_row,role,state\n"
    "500010.5,5333989.5,13,14,fit,used\n"
    "500050.5,5333949.5,55,50,check,used\n"
)


def test_places_are_drawn_where_they_are(tmp_path: Path) -> None:
    simulate(tmp_path, 80, distortion="shift", shift=6.0)
    shift_px = search_figures._true_shift_px(tmp_path, None, None)
    assert np.hypot(*shift_px) == pytest.approx(6.0, abs=1e-6)
    points = tmp_path / "points.csv"
    points.write_text(POINTS, encoding="utf-8")
    axes = Figure().add_subplot()
    search_figures._draw_displacements(axes, tmp_path, points)
    fit, check = (arrows.XY for arrows in axes.collections)
    np.testing.assert_allclose([*fit, *check], [[10.5, 10.5], [50.5, 50.5]], atol=1e-6)
