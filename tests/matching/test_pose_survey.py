from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, write_raster
from turned_pairs import turned_pair

from groundtie.context import Context
from groundtie.matching.pose_survey import PoseSurvey, _moved, survey_pose
from groundtie.matching.shared_content import ImageKinds, Sensors
from groundtie.pose.pose import Pose
from groundtie.pose.rotation_windows import read_windows
from groundtie.rasters.grid import Grid, mesh
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster

TRUTH = Pose(50.0, 1.1, (4.0, -6.0))


def surveyed(
    folder: Path, pose: Pose, context: Context, moved: tuple[int, int] = (0, 0), **more: int
) -> PoseSurvey:
    """Survey around a pose a pair whose true pose is `TRUTH`; the input's last rows are displaced.

    `moved` gives the number of rows and their displacement in columns.
    """
    with ExitStack() as stack:
        images, turned = [], turned_pair(TRUTH, (250, 250), (260, 260), **more)
        for name, window in zip("ri", turned, strict=True):
            values = np.clip(window.values, 1, 65_535).astype(np.uint16)
            if name == "i":
                values[-moved[0] :] = np.roll(values[-moved[0] :], moved[1], axis=1)
            path = write_raster(folder / f"{name}.tif", values)
            images.append(Image(stack.enter_context(open_raster(path))))
        windows = read_windows(*images, (0.8, 1.25))
        pair = make_pair(*images, None, windows.radius_m, 180.0, 1.25)
        return survey_pose(pair, windows.transform(pose), 0.02, ImageKinds(Sensors.RADARS), context)


# The true pose, and one with a tolerable error.
@pytest.mark.slow
@pytest.mark.parametrize("pose", [TRUTH, replace(TRUTH, rotation_deg=51.5)])
def test_chips_confirm_a_pose(pose: Pose, tmp_path: Path, context: Context) -> None:
    found = surveyed(tmp_path, pose, context)
    assert len(found.agrees) >= 15
    assert found.agrees.mean() > 0.9
    survey = found.surveys.whole
    assert survey is not None and survey.confirming > 0.9 * len(found.agrees)
    assert found.surveys.parts == []
    rest = found.surveys.rest
    assert rest is not None and not rest.shared.is_evident


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pose", "more"),
    [
        (replace(TRUTH, rotation_deg=-130.0), {}),
        (TRUTH, {"input_seed": 99}),
    ],
)
def test_chips_confirm_no_wrong_pose(
    pose: Pose, more: dict[str, int], tmp_path: Path, context: Context
) -> None:
    found = surveyed(tmp_path, pose, context, **more)
    assert found.agrees.mean() < 0.25


@pytest.mark.slow
def test_a_strip_that_moved_is_found_by_smaller_chips(tmp_path: Path, context: Context) -> None:
    """The strip is too narrow for three of the chips that confirm the pose."""
    surveys = surveyed(tmp_path, TRUTH, context, moved=(50, 10)).surveys
    assert surveys.whole is not None and surveys.whole.parts == []
    (part,) = surveys.parts
    assert part.distance_px == pytest.approx(10 / TRUTH.scale, abs=0.7)


@pytest.mark.slow
def test_images_that_hardly_overlap_confirm_nothing(tmp_path: Path, context: Context) -> None:
    found = surveyed(tmp_path, replace(TRUTH, shift_px=(170.0, 150.0)), context)
    assert found.agrees.mean() < 0.25


@pytest.mark.parametrize("height_m", [1.0, 2.0, 0.5])
def test_a_pose_is_refined_on_the_ground_by_pixels_of_any_shape(height_m: float) -> None:
    """Surfaces have their peaks where a rotation by 1° on the ground puts the chips."""
    grid = Grid(Affine(1, 0, 500_000, 0, -height_m, 5_000_000), UTM, 500, 500)
    px = mesh(np.arange(50, 500, 100), np.arange(50, 500, 100)).astype(int)
    turn, sides = np.deg2rad(1.0), np.array([1.0, height_m])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    moved = 250 + ((px - 250) * sides @ rotation.T) / sides
    offset = np.arange(-20, 21)
    surfaces = np.array(
        [np.exp(-((offset[:, None] - y) ** 2 + (offset - x) ** 2) / 8) for x, y in moved - px],
        np.float32,
    )
    found = _moved(px, surfaces, grid)
    np.testing.assert_allclose(found.model(px), moved, atol=0.05)
    for model in found.fold_models:
        np.testing.assert_allclose(model(px), moved, atol=0.1)
