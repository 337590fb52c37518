"""Parts that lie elsewhere are named by place, distance and direction, and drawn apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evidences import survey
from known_reports import Page, report_of, written
from matplotlib.quiver import Quiver

from groundtie.rasters.pair import ImagePair
from groundtie.report import parts
from groundtie.report.figures import FIT_COLOUR
from groundtie.report.parts import COLOURS, parts_map

# Chips of the two upper rows lie 9 px to the right and 5 px up, of 10 m each.
TWO_ROWS = survey(35, part=14)


def test_a_part_is_named_by_place_distance_and_direction() -> None:
    (line,) = parts.lines(TWO_ROWS)
    assert line.startswith("top: 14 chips lie 10.3 px off (90.0 m east, 50.0 m north)")
    assert line.endswith("; 0 of them confirm the transform")


def test_numbers_of_a_part() -> None:
    (part,) = parts.summary(TWO_ROWS)
    assert part["shift_px"] == (9.0, -5.0)
    assert part["distance_px"] == pytest.approx(np.hypot(9, 5))
    assert (part["chips"], part["confirming"]) == (14, 0)
    assert part["excess"] == pytest.approx(7 * np.sqrt(13))


def test_chips_that_fell_anywhere_are_no_part() -> None:
    anywhere = survey(30)
    assert parts.shown(anywhere)["rows"] == []
    assert parts.summary(anywhere) == []


def test_coverage_names_where_most_hardly_matches() -> None:
    # Chips of the two upper rows do not match where the others do.
    assert parts.counts(TWO_ROWS) == {"chips": 49, "confirming": 35, "hardly_matching": 14}
    assert parts.coverage(TWO_ROWS) == (
        "35 of 49 chips confirm the transform, 14 hardly match, 14 of them side by side "
        "around the top"
    )
    assert parts.coverage(survey(49)) == "49 of 49 chips confirm the transform, 0 hardly match"


def test_the_map_has_an_arrow_for_every_chip_of_a_part_in_its_colour() -> None:
    axes = parts_map(TWO_ROWS).axes[0]
    arrows, scale = (c for c in axes.collections if isinstance(c, Quiver))
    assert (arrows.N, scale.N) == (14, 1)
    drawn = np.column_stack([arrows.U, arrows.V])
    # They point from where the transform has the chips, rows downwards.
    np.testing.assert_allclose(drawn / drawn[:, :1], np.full((14, 2), [1, -5 / 9]))
    confirming = [line for line in axes.lines if line.get_color() == FIT_COLOUR]
    assert [len(line.get_xdata()) for line in confirming] == [35]
    assert [len(line.get_xdata()) for line in axes.lines if line.get_color() == COLOURS[0]] == [14]


def test_without_parts_the_map_has_no_arrows() -> None:
    axes = parts_map(survey(49)).axes[0]
    assert not any(isinstance(c, Quiver) for c in axes.collections)
    shown = {
        line.get_color(): len(line.get_xdata()) for line in axes.lines if len(line.get_xdata())
    }
    assert shown == {FIT_COLOUR: 49}


@pytest.mark.slow
def test_a_page_shows_parts_whatever_the_verdict(pair: ImagePair, tmp_path: Path) -> None:
    page: Page = written(report_of(pair, survey=TWO_ROWS), tmp_path)
    assert "Parts that lie elsewhere" in [e.text for e in page.all("h2")]
    assert "Top: 14 chips lie 10.3 px off" in page.text
    without = written(report_of(pair, survey=survey(49)), tmp_path)
    assert "Parts that lie elsewhere" not in [e.text for e in without.all("h2")]
