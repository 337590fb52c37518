from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from contexts import context
from turned_pairs import patch, turned_pair

from groundtie.context import Context
from groundtie.errors import OutputError
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose
from groundtie.report.rotation_picture import checkerboard, draw_rotation

__all__ = ["context"]

TRUTH = Pose(30.0, 1.2, (5.0, 5.0))


class TestCheckerboard:
    def test_squares_by_turns(self) -> None:
        rng = np.random.default_rng(0)
        reference, input = patch(rng.normal(size=(80, 80))), patch(np.zeros((80, 80)))
        input.values[:, 40:] = 1
        board = checkerboard(reference, input, Pose())
        assert board.shape == (80, 80)
        # Eight squares a side: the second is the input's, dark on its left half.
        assert not board[:10, 10:20].any()
        assert (board[:10, 50:60] == 255).all()
        assert board[:10, :10].std() > 20

    def test_the_input_lies_where_its_pose_puts_it(self) -> None:
        truth = Pose(90.0)
        reference = patch(np.random.default_rng(0).normal(size=(64, 64)))
        input = patch(np.rot90(reference.values).copy())
        board = checkerboard(reference, input, truth).astype(int)
        plain = checkerboard(reference, reference, Pose()).astype(int)
        assert np.abs(board - plain).max() <= 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limits", "pose"),
    [
        (SearchLimits(20, 180, (0.8, 1.25)), TRUTH),
        (SearchLimits(10), TRUTH),
        (SearchLimits(10, 10), None),
    ],
)
def test_a_picture_is_drawn(
    tmp_path: Path, limits: SearchLimits, pose: Pose | None, context: Context
) -> None:
    path = tmp_path / "picture.png"
    draw_rotation(path, *turned_pair(TRUTH), limits, pose, "a title", context)
    image = cv2.imread(str(path))
    assert image.shape[0] > 500
    assert image.std() > 20


@pytest.mark.slow
def test_a_disk_that_cannot_be_written_to(tmp_path: Path, context: Context) -> None:
    windows = turned_pair(TRUTH)
    with pytest.raises(OutputError):
        draw_rotation(
            tmp_path / "no" / "p.png", *windows, SearchLimits(10), TRUTH, "a title", context
        )
