"""The masks of a pair: the user's, and the mask of a dense town's ground."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from brightness_classifiers import bright_is_left_out
from canopies import draw_country
from contexts import context
from facts_of_pairs import FIELDS, TOWN, opened, speckled

from groundtie.context import Context
from groundtie.masks.used import INPUT, LAYER, OPEN, REFERENCE
from groundtie.rasters.pair import ImagePair
from groundtie.registration.masks import Masked, ground_instead, with_ground_mask
from groundtie.registration.scene import SceneInfo
from groundtie.registration.user_masks import UserMask, with_user_masks

__all__ = ["context"]
NO_RADAR = "there is no radar image beside a camera's"


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


def masked(pair: ImagePair, stack: ExitStack, context: Context, declared: str = "auto") -> Masked:
    return with_ground_mask(pair, SceneInfo.of(pair, declared), stack, context)


def test_whoever_names_the_radar_image_is_believed(
    tmp_path: Path, stack: ExitStack, context: Context
) -> None:
    with opened(tmp_path, TOWN, FIELDS) as pair:
        used = masked(pair, stack, context).used
        assert (used.kind, used.reason) == ("none", NO_RADAR)
        used = masked(pair, stack, context, declared=REFERENCE).used
        assert (used.kind, used.image) == ("ground", REFERENCE)
        used = masked(pair, stack, context, declared=INPUT).used
        assert used.kind == "none" and "too few for a town" in used.reason


@pytest.mark.parametrize(
    ("pixel_m", "kind", "elevated_px"),
    [(3.0, "ground", 0.65), (4.0, "none", 2.5), (None, "none", 0.0)],
)
def test_a_town_in_large_pixels_takes_part_as_a_whole(
    tmp_path: Path,
    stack: ExitStack,
    context: Context,
    pixel_m: float | None,
    kind: str,
    elevated_px: float,
) -> None:
    """Elevated objects displace the whole by 10 m, the supposed ground by less than a pixel.

    In pixels of unknown size, a rule refuses it.
    """
    with opened(tmp_path, speckled(0.25), FIELDS, pixel_m=pixel_m) as pair:
        used = masked(pair, stack, context).used
        assert used.kind == kind and "as in a town" in used.reason
        assert used.elevated_px == pytest.approx(elevated_px)


def test_fields_need_no_ground(tmp_path: Path, stack: ExitStack, context: Context) -> None:
    with opened(tmp_path, speckled(0.02), FIELDS) as pair:
        result = masked(pair, stack, context)
        assert (result.used.kind, result.pair) == ("none", pair)


@pytest.mark.parametrize(
    ("forest_share", "kind"),
    [(0.0, None), (0.3, OPEN), (0.75, None)],
    ids=["all is open", "forest", "mostly forest"],
)
def test_open_ground_is_matched_alone_where_it_is_most_and_not_all(
    tmp_path: Path, stack: ExitStack, context: Context, forest_share: float, kind: str | None
) -> None:
    """Otherwise it would repeat the same registration, or be outvoted."""
    country = draw_country(420, forest_share, seed=1)
    with opened(tmp_path, country.seen(0, 4.0, 1), country.seen(8, 4.0, 2)) as pair:
        ground = ground_instead(pair, SceneInfo.of(pair), stack, context)
        assert (None if ground is None else ground.used.kind) == kind


def test_masks_of_the_reference_go_with_it(
    tmp_path: Path, stack: ExitStack, context: Context
) -> None:
    with opened(tmp_path, speckled(0.25), FIELDS) as pair:
        result = masked(pair, stack, context)
        (tmp_path / "other").mkdir()
        with opened(tmp_path / "other", FIELDS, FIELDS) as other:
            moved = result.on(other)
            assert moved.pair.reference is result.pair.reference
            assert moved.pair.reference.mask is not None
            assert moved.pair.input is other.input and moved.used is result.used
        exchanged = result.exchanged()
        assert exchanged.pair.input is result.pair.reference and exchanged.used is result.used


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
        both, used = with_user_masks(pair, (layer, classifier), stack, context)
        assert used is not None
        assert (used.kind, used.image, used.reason) == (
            LAYER,
            REFERENCE,
            "what left.geojson covers",
        )
        assert both.reference.mask is not None and both.input.mask is not None
        valid = both.reference_patch(both.grid).valid
        assert valid[:, :199].all() and not valid[:, 201:].any()
        # Nothing in the fields is bright.
        assert both.input_patch(both.grid, both.nominal_px).valid.mean() > 0.9
        alone, used = with_user_masks(pair, (classifier, None), stack, context)
        assert used is None
        shown = alone.reference_patch(alone.grid)
        bright = pair.reference_patch(pair.grid).values
        assert bright[~shown.valid].mean() > 1.5 * bright[shown.valid].mean()
        same, used = with_user_masks(pair, (None, None), stack, context)
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
