"""The suite of rotations: what is drawn and judged, figures of [Patel2017] beside ours."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from posed_windows import window

from benchmarks.injected import BLACK, MASKED, WHOLE, Injection
from benchmarks.rotation import (
    LARGE,
    LARGEST_SHIFT_PX,
    MELLIN,
    METHODS,
    PHASE,
    RADON,
    RANGES,
    SHIFTS,
    SMALL,
    STAND_INS,
    Found,
    Range,
    errors_table,
    goals,
    search,
    side_for,
    thesis_table,
    variants,
)
from benchmarks.tables import to_markdown
from benchmarks.thesis_radon import ACTUAL, ESTIMATES, SIZES
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose

ONE = Found(
    "hills", SMALL.name, RADON, "fused", WHOLE, 0.0, 12.0, 1.0, 0.05, 0.2, (0.1, 0.3), 50.0, 0.4
)


def everything(**changed: float) -> list[Found]:
    """One search of every method in every range, and a noisy one that is far off."""
    found = []
    for range_ in RANGES:
        for method in range_.methods:
            one = replace(ONE, range=range_.name, method=method, **changed)
            noisy = replace(one, noise_variance=0.005, rotation_error_deg=90.0, error_px=90.0)
            found += [one, noisy, replace(noisy, noise_variance=0.0, corners=BLACK)]
    return found


@pytest.mark.parametrize("range_", RANGES, ids=lambda r: r.name)
def test_poses_are_drawn_within_their_limits(range_: Range) -> None:
    poses = [range_.draw(seed) for seed in range(50)]
    turned = np.array([pose.rotation_deg for pose in poses])
    scales = np.array([pose.scale for pose in poses])
    assert np.abs(turned).max() <= range_.limits.rotation_deg
    assert (scales >= range_.limits.scale[0] - 1e-9).all()
    assert (scales <= range_.limits.scale[1] + 1e-9).all()
    assert max(np.abs(pose.shift_px).max() for pose in poses) <= LARGEST_SHIFT_PX
    assert range_.draw(7) == range_.draw(7) != range_.draw(8)


def test_ranges_are_the_goals() -> None:
    assert SMALL.limits.rotation_deg == 30
    assert (LARGE.limits.rotation_deg, LARGE.limits.scale) == (180, (0.5, 2.0))
    assert set(METHODS) == {PHASE, MELLIN, RADON}
    assert {corners for corners, _ in variants(SMALL)} == {WHOLE, MASKED, BLACK}
    assert {variance for _, variance in variants(SHIFTS)} == {0.0, 0.001, 0.005}


def test_a_turned_window_stays_inside_the_image() -> None:
    image = np.zeros((300, 400), np.float32)
    side = side_for(image, WHOLE)
    for degrees in (0.0, 30.0, 45.0):
        pose = Pose(degrees, 1.0, (LARGEST_SHIFT_PX, LARGEST_SHIFT_PX))
        assert Injection(pose).windows(image, (side, side))[1].valid.all()
    assert side_for(image, MASKED) == 300
    assert side_for(np.zeros((3000, 2000)), WHOLE) == 512


@pytest.mark.parametrize("method", METHODS)
def test_a_search_is_judged_by_what_was_put_in(method: str) -> None:
    image = window((220, 220)).values / 1000
    pose = Pose(0.0 if method == PHASE else 12.0, 1.0, (4.0, -6.0))
    limits = SearchLimits(20.0, 30.0)
    found = search("hills", "any", image, (128, 128), Injection(pose), method, "ncc", limits)
    assert found.error_px < 0.5 and found.rotation_error_deg < 0.25
    assert max(found.shift_errors_px) < 0.5
    assert (found.rotation_deg, found.scale) == (pose.rotation_deg, 1.0)
    assert found.seconds > 0
    json.dumps(asdict(found), allow_nan=False)


def test_goals_are_judged_without_noise_and_with_whole_corners() -> None:
    made = goals(everything(), enough=True)
    assert [goal.what.split(":")[0] for goal in made] == [
        f"{PHASE}, {SHIFTS.name}",
        f"{MELLIN}, {SMALL.name}",
        f"{RADON}, {SMALL.name}",
        f"{MELLIN}, {LARGE.name}",
    ]
    assert all(goal.reached for goal in made)
    assert all(goal.found == "0.050° and 0.200 px" for goal in made)


def test_radon_may_turn_by_more() -> None:
    reached = {g.what: g.reached for g in goals(everything(rotation_error_deg=0.2), enough=True)}
    assert [what.split(",")[0] for what, good in reached.items() if good] == [RADON]
    assert not any(g.reached for g in goals(everything(error_px=0.6), enough=True))


def test_a_quick_run_reaches_nothing() -> None:
    assert all(goal.reached is None for goal in goals(everything(), enough=False))


def test_errors_are_grouped_by_how_was_searched() -> None:
    some = [ONE, replace(ONE, error_px=3.0, rotation_error_deg=0.35), replace(ONE, method=MELLIN)]
    table = errors_table(some)
    rows = {row[0]: dict(zip(table.head, row, strict=True)) for row in table.rows}
    assert set(rows) == {RADON, MELLIN}
    radon = rows[RADON]
    assert (radon["images"], radon["within 1 px"]) == ("2", "1")
    assert (radon["median °"], radon["largest °"]) == ("0.200", "0.350")
    assert (radon["median px"], radon["largest px"]) == ("1.600", "3.000")


def test_the_thesis_figures_are_as_printed() -> None:
    """Differences worked out by hand from some rows of P's tables."""
    by_image = {(e.image, e.noise_variance): e.errors() for e in ESTIMATES}
    assert by_image["image-1", 0.0][1] == (1.5, 2, 2)
    assert by_image["image-3", 0.0][2] == (0.5, 22, 1)
    assert by_image["image-4", 0.0][3] == (1, 1, 1)
    assert by_image["image-1", 0.005][3] == (1.5, 1, 12)
    assert len(ESTIMATES) == 4 + 2 * 2
    assert set(STAND_INS) == set(SIZES)
    assert all(STAND_INS[name][1] == SIZES[name] for name in ("image-1", "image-2", "image-4"))


def test_the_thesis_stands_beside_ours() -> None:
    own = [
        replace(ONE, rotation_error_deg=index / 100, shift_errors_px=(index / 10, 0.5))
        for index in range(len(ESTIMATES) * len(ACTUAL))
    ]
    table = thesis_table(own)
    assert len(table.rows) == 32
    assert list(table.rows[1]) == [
        "image-1 (489×300)",
        "0",
        "20, 5, 17",
        *("1.5", "2", "2"),
        *("0.010", "0.100", "0.500"),
    ]
    assert table.rows[-1][1] == "0.005"
    assert to_markdown(table).count("\n") == 36
