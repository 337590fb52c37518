from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from raster_files import write_raster
from textured_pairs import TexturedPair, error_px, pixels, shift_on_map, write_textured_pair

from groundtie.context import threads
from groundtie.errors import TooFewPointsError
from groundtie.features.detectors import SiftDetector
from groundtie.features.hog import HogDescriptor
from groundtie.geometry.estimation import Estimate
from groundtie.geometry.transform import Transform
from groundtie.matching.alignment import LINEAR_CANDIDATES
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.feature_fit import first_kind
from groundtie.matching.held_out import HeldOut
from groundtie.matching.keypoint_fit import GuidedFit, agreeing_keypoints
from groundtie.matching.keypoints import KeypointMatcher
from groundtie.matching.surface_fit import SurfaceFit
from groundtie.similarity.surface import SimilaritySettings

SIZE = (400, 380)
FUSED = SimilaritySettings("fused")
# The truth is 6 px east and 4 px south; the coarse model is wrong by 5 px.
TRUTH, COARSE = shift_on_map(60.0, -40.0), shift_on_map(30.0, 0.0)

# Roofs: their side, their spacing, and their displacement against the ground.
ROOF_PX, APART_PX, PARALLAX_PX = 20, 48, 4


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    return write_textured_pair(tmp_path_factory.mktemp("plain"), SIZE, TRUTH, noise=0.1)


@pytest.fixture(scope="module")
def town(files: TexturedPair, tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    """Return a pair with a sixth of the ground under roofs, which have the strongest edges."""
    reference, input = pixels(files.reference)[0].copy(), pixels(files.input)[0].copy()
    random = np.random.default_rng(5)
    for row in range(20, SIZE[1] - 50, APART_PX):
        for col in range(20, SIZE[0] - 50, APART_PX):
            tiles = random.integers(0, 2, (5, 5), dtype=np.uint16) * 40_000
            roof = np.kron(tiles, np.ones((ROOF_PX // 5,) * 2, np.uint16))
            there = np.rint(files.truth(files.grid.pixel_to_map([[col, row]]))).astype(int)[0]
            reference[row : row + ROOF_PX, col : col + ROOF_PX] = roof
            left = there[0] + PARALLAX_PX
            input[there[1] : there[1] + ROOF_PX, left : left + ROOF_PX] = roof
    folder = tmp_path_factory.mktemp("town")
    return replace(
        files,
        reference=write_raster(folder / "reference.tif", reference, files.grid),
        input=write_raster(folder / "input.tif", input, files.truth.input_grid),
    )


def estimates(
    files: TexturedPair, kind: str = "auto", threshold: float = 0.03
) -> tuple[Transform, Estimate]:
    """Return the models from keypoints alone, and with chips all over the images."""
    with files.opened() as pair, threads(2) as context:
        held_out = HeldOut.of(pair)
        chips = SurfaceFit(ChipMatcher(pair, FUSED, held_out), held_out.layout, LINEAR_CANDIDATES)
        matcher = KeypointMatcher(pair, SiftDetector(threshold), HogDescriptor(), held_out=held_out)
        _, fit = agreeing_keypoints(matcher, COARSE, first_kind(kind), context)
        nominal = Transform.nominal(pair.grid.crs, pair.input.source.grid)
        alone = replace(nominal, model=fit.model.on_map(pair.grid.centre_transform))
        return alone, GuidedFit(matcher, chips).estimate(COARSE, kind, context)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["auto", "polynomial2", "tps"])
def test_a_misregistration_is_recovered(files: TexturedPair, kind: str) -> None:
    _, found = estimates(files, kind)
    assert error_px(found.transform, files) < (0.6 if kind == "tps" else 0.3)
    assert found.transform.model.kind == ("translation" if kind == "auto" else kind)
    assert not found.points.is_check.any()


@pytest.mark.slow
def test_ground_counts_by_its_area_and_roofs_do_not_outvote_it(town: TexturedPair) -> None:
    alone, found = estimates(town)
    assert error_px(alone, town) > 2.0
    assert error_px(found.transform, town) < 1.0


def test_without_keypoints_nothing_shows_where_to_look(files: TexturedPair) -> None:
    with pytest.raises(TooFewPointsError):
        estimates(files, threshold=0.9)
