"""The search from coarse to fine pyramid levels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from textured_pairs import TexturedPair, error_m, shift_on_map, write_textured_pair

from groundtie.context import Context
from groundtie.errors import CancelledError, NothingFoundError
from groundtie.geometry.limits import SearchLimits
from groundtie.geometry.models import Model
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.held_out import HeldOut
from groundtie.matching.pyramid import find_coarse_model
from groundtie.progress import Progress
from groundtie.rasters.pair import ImagePair
from groundtie.similarity.surface import SimilaritySettings


def coarse_model(pair: ImagePair, radius_m: float, context: Context) -> Model:
    pair = replace(pair, limits=SearchLimits(radius_m))
    matcher = ChipMatcher(pair, SimilaritySettings("orientation"), HeldOut.of(pair))
    return find_coarse_model(matcher, context)


@pytest.mark.parametrize("size", [(260, 240), (700, 200)])
@pytest.mark.slow
def test_from_the_coarse_shift_to_a_model(
    tmp_path: Path, context: Context, size: tuple[int, int]
) -> None:
    files = write_textured_pair(tmp_path, size, shift_on_map(-90.0, 110.0))
    with files.opened() as pair:
        model = coarse_model(pair, 200.0, context)
    assert error_m(model, files) < 10


@pytest.mark.slow
def test_a_radius_larger_than_the_scene_is_no_more_work_than_the_scene(
    textured: TexturedPair, pair: ImagePair, context: Context
) -> None:
    """A thousand kilometres: beyond the scene's size there is nothing left to compare."""
    model = coarse_model(pair, 1e6, context)
    assert error_m(model, textured) < 10


def test_cancelling(pair: ImagePair, context: Context) -> None:
    progress = Progress(is_cancelled=lambda: True)
    with pytest.raises(CancelledError):
        coarse_model(pair, 200.0, replace(context, progress=progress))


@pytest.mark.slow
def test_two_places_are_not_found_in_each_other(
    other_place: TexturedPair, context: Context
) -> None:
    """Any transform that is found is no better than chance, which the verdict judges."""
    with other_place.opened() as pair, pytest.raises(NothingFoundError):
        coarse_model(pair, 200.0, context)
