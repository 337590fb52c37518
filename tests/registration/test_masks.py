"""Which masks a pair gets: the user's, and that of a dense town's ground."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from brightness_classifiers import bright_is_left_out
from contexts import context
from facts_of_pairs import FIELDS, TOWN, opened, speckled

from groundtie.context import Context
from groundtie.errors import ParameterError
from groundtie.masks.choice import INPUT, LAYER, REFERENCE, MaskUsed
from groundtie.rasters.pair import ImagePair
from groundtie.registration import masks
from groundtie.registration.masks import (
    Masked,
    require_one_mask,
    with_ground_mask,
)
from groundtie.registration.scene import SceneInfo
from groundtie.registration.user_masks import UserMask, named_masks, with_user_masks

__all__ = ["context"]
NO_RADAR = "there is no radar image beside a camera's"


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


def masked(
    pair: ImagePair, stack: ExitStack, context: Context, kind: str = "auto", declared: str = "auto"
) -> Masked:
    return with_ground_mask(pair, kind, SceneInfo.of(pair, declared), stack, context)


def test_whoever_names_the_radar_image_is_believed(
    tmp_path: Path, stack: ExitStack, context: Context
) -> None:
    with opened(tmp_path, TOWN, FIELDS) as pair:
        used = masked(pair, stack, context).used
        assert (used.kind, used.reason) == ("none", NO_RADAR)
        used = masked(pair, stack, context, declared=REFERENCE).used
        assert (used.kind, used.image) in (("threshold", REFERENCE), ("regions", REFERENCE))
        used = masked(pair, stack, context, declared=INPUT).used
        assert used.kind == "none" and "too few buildings" in used.reason


@pytest.mark.slow
def test_a_towns_ground_is_masked_once_for_fit_and_check(
    tmp_path: Path, stack: ExitStack, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where more than the ground takes part in the fit, the ground alone checks it."""
    found = masks.find_ground
    calls = []

    def counted(*given: object, **named: object) -> object:
        calls.append(given)
        return found(*given, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(masks, "find_ground", counted)
    with opened(tmp_path, speckled(0.25), FIELDS) as pair:
        scene = SceneInfo.of(pair)
        assert scene.is_dense_town
        for kind, has_ground in (("regions", False), ("threshold", True), ("none", True)):
            calls.clear()
            result = with_ground_mask(pair, kind, scene, stack, context)
            assert result.used.kind == kind and len(calls) == 1
            assert (result.ground is not None) == has_ground
            assert (result.pair.reference.mask is None) == (kind == "none")
        calls.clear()
        chosen = with_ground_mask(pair, "auto", scene, stack, context)
        assert chosen.used.image == REFERENCE and len(calls) == 1


def test_fields_need_no_ground(tmp_path: Path, stack: ExitStack, context: Context) -> None:
    with opened(tmp_path, speckled(0.02), FIELDS) as pair:
        for kind in ("auto", "none"):
            result = masked(pair, stack, context, kind)
            assert (result.used.kind, result.ground, result.pair) == ("none", None, pair)
        assert masked(pair, stack, context, "threshold").ground is None


def test_masks_of_the_reference_go_with_it(
    tmp_path: Path, stack: ExitStack, context: Context
) -> None:
    with opened(tmp_path, speckled(0.25), FIELDS) as pair:
        result = masked(pair, stack, context, "threshold")
        (tmp_path / "other").mkdir()
        with opened(tmp_path / "other", FIELDS, FIELDS) as other:
            moved = result.on(other)
            assert moved.pair.reference is result.pair.reference
            assert moved.pair.input is other.input and moved.used is result.used
            assert moved.ground is not None and result.ground is not None
            assert moved.ground.reference is result.ground.reference


@pytest.mark.slow
def test_layers_and_classifiers_become_rasters(
    tmp_path: Path, stack: ExitStack, context: Context
) -> None:
    with opened(tmp_path, TOWN, FIELDS) as pair:
        left, top = pair.grid.pixel_to_map([[-0.5, -0.5]])[0]
        ring = [[left, top], [left + 200, top], [left + 200, top - 400], [left, top - 400]]
        layer = tmp_path / "left.geojson"
        crs = {"type": "name", "properties": {"name": pair.grid.crs.to_string()}}
        polygon = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
        feature = {"type": "Feature", "properties": {}, "geometry": polygon}
        text = json.dumps({"type": "FeatureCollection", "crs": crs, "features": [feature]})
        layer.write_text(text)
        classifier = bright_is_left_out(tmp_path / "bright.json", 120.0)
        both, used = with_user_masks(pair, named_masks((layer, classifier)), stack, context)
        assert used is not None
        assert (used.kind, used.image, used.reason) == (
            LAYER,
            REFERENCE,
            "what left.geojson covers",
        )
        assert both.reference.mask is not None and both.input.mask is not None
        valid = both.reference_patch(both.grid).valid
        assert valid[:, :199].all() and not valid[:, 201:].any()
        # Nothing of the fields is bright.
        assert both.input_patch(both.grid, both.nominal_px).valid.mean() > 0.9
        alone, used = with_user_masks(pair, named_masks((classifier, None)), stack, context)
        assert used is None
        shown = alone.reference_patch(alone.grid)
        bright = pair.reference_patch(pair.grid).values
        assert bright[~shown.valid].mean() > 1.5 * bright[shown.valid].mean()
        same, used = with_user_masks(pair, named_masks((None, None)), stack, context)
        assert same is pair and used is None


@pytest.mark.parametrize(
    ("mask", "expected"),
    [
        ("a.tif", True),
        ("a.vrt", True),
        ("a.json", False),
        ("a.gpkg", False),
        ("a.GeoJSON", False),
    ],
)
def test_rasters_are_recognised_by_their_ending(mask: str, expected: bool) -> None:
    assert UserMask(mask).is_raster == expected


def test_a_layer_and_a_kind_of_mask_are_one_too_many() -> None:
    layer = MaskUsed(LAYER, REFERENCE, 0.5, "what roads.gpkg covers")
    for kind in ("auto", "none"):
        require_one_mask(kind, layer)
    require_one_mask("regions", None)
    with pytest.raises(ParameterError, match="either mask=regions or a vector layer"):
        require_one_mask("regions", layer)
