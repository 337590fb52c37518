"""User masks: by values, inverted, and found beside an image."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from contexts import context
from facts_of_pairs import FIELDS, TOWN, opened
from raster_files import utm_grid, write_raster
from scipy.ndimage import gaussian_filter

from groundtie import coregister
from groundtie.context import Context
from groundtie.errors import NotRegisteredError, ParameterError
from groundtie.rasters.grid import Grid
from groundtie.registration.asked import asked_masks
from groundtie.registration.scene import SceneInfo
from groundtie.registration.user_masks import UserMask, with_user_masks

__all__ = ["context"]


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as found:
        yield found


def half_cloudy(path: Path, grid: Grid) -> Path:
    """Write a classification with a cloud over the right half."""
    values = np.full((grid.height, grid.width), 4, np.uint8)
    values[:, grid.width // 2 :] = 9
    return write_raster(path, values, grid)


def rectangle(path: Path, grid: Grid, width: int, height: int) -> Path:
    """Write a layer that covers so many pixels to the right of and below a grid's corner."""
    corners = [[0, 0], [width, 0], [width, height], [0, height], [0, 0]]
    ring = grid.pixel_to_map(np.array(corners) - 0.5).tolist()
    polygon = {"type": "Polygon", "coordinates": [ring]}
    feature = {"type": "Feature", "properties": {}, "geometry": polygon}
    crs = {"type": "name", "properties": {"name": grid.crs.to_string()}}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": [feature]}))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("is_masked", [False, True])
def test_a_layer_over_all_does_not_hide_that_a_scene_repeats(
    tmp_path: Path, is_masked: bool
) -> None:
    """A period of 100 px is seen, also under a mask that leaves it whole."""
    rng = np.random.default_rng(0)
    tiled = np.tile(gaussian_filter(rng.normal(size=(100, 100)), 2, mode="wrap"), (5, 5))
    grid = utm_grid(480, 480)
    files = [
        write_raster(
            tmp_path / f"{name}.tif",
            (1000 + times * tiled[at : at + 480, at : at + 480] + rng.normal(0, 40, (480, 480)))
            .clip(1)
            .astype(np.uint16),
            grid,
        )
        for name, at, times in (("reference", 0, 900), ("input", 5, -900))
    ]
    mask = rectangle(tmp_path / "all.geojson", grid, 480, 480) if is_masked else None
    with pytest.raises(NotRegisteredError) as refused:
        coregister(*files, None, reference_mask=mask)
    assert refused.value.verdict.rule == "second place far off"


def test_values_hide_clouds_and_say_nothing_of_the_ground(
    tmp_path: Path, stack: ExitStack, context: Context
) -> None:
    with opened(tmp_path, TOWN, FIELDS) as pair:
        grid = pair.input.source.grid
        path = half_cloudy(tmp_path / "scl.tif", grid)
        mask = UserMask.of("input.tif", path, "scl")
        masked, used = with_user_masks(pair, (None, mask), stack, context)
        valid = masked.input_patch(masked.grid, masked.nominal_px).valid
        middle = valid.shape[1] // 2
        assert valid[5:-5, 5 : middle - 2].all() and not valid[:, middle + 2 :].any()
        assert used is None and masked.is_masked
        assert not SceneInfo.of(masked).has_user_mask
        (note,) = masked.notes()
        assert note.startswith("scl.tif keeps ") and note.endswith("% of the input")


def test_a_layer_may_show_what_takes_no_part(
    tmp_path: Path, stack: ExitStack, context: Context
) -> None:
    with opened(tmp_path, TOWN, FIELDS) as pair:
        layer = rectangle(tmp_path / "clouds.geojson", pair.grid, 200, 400)
        found = []
        for values in (None, "inside"):
            mask = UserMask.of("input.tif", layer, values)
            masked, used = with_user_masks(pair, (mask, None), stack, context)
            found.append(masked.reference_patch(masked.grid).valid)
            assert (used is None) == (values == "inside")
        everything = pair.reference_patch(pair.grid).valid
        np.testing.assert_array_equal(found[0] ^ found[1], everything)
        assert found[0][:, :199].all() and not found[1][:, :199].any()


def test_a_mask_beside_the_image_is_taken_unless_it_is_not_wanted(tmp_path: Path) -> None:
    image = tmp_path / "T32UQD_20200620T101031_B04_20m.jp2"
    beside = tmp_path / "T32UQD_20200620T101031_SCL_20m.jp2"
    beside.touch()
    found = UserMask.of(image, None, None)
    assert found is not None
    assert (found.mask, found.values) == (beside, "scl")
    assert found.origin == f", found beside {image.name},"
    assert UserMask.of(image, None, "none") is None
    own = UserMask.of(image, tmp_path / "own.tif", None)
    assert own is not None and own.mask == tmp_path / "own.tif" and own.is_zeros
    assert UserMask.of(np.zeros((3, 3)), None, None) is None


@pytest.mark.parametrize(
    ("mask", "values", "message"),
    [
        (None, "scl", "there is no mask that the values scl belong to"),
        ("clouds.gpkg", "3", "the only value of a vector layer is inside"),
        ("a.json", "3", "a classifier has no values"),
        ("a.tif", "inside", "must be numbers up to"),
        ("a.tif", "none", "must be numbers up to"),
    ],
)
def test_values_belong_to_their_kind_of_mask(mask: str | None, values: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        UserMask.of("input.tif", mask, values)


@pytest.mark.parametrize(
    ("values", "masks", "expected"),
    [
        (None, ("a.tif", "b.tif"), (None, None)),
        ("1; scl", ("a.tif", "b.tif"), ("1", "scl")),
        ("; scl", ("a.tif", "b.tif"), (None, "scl")),
        ("3,8-10", ("a.tif", "b.tif"), ("3,8-10", "3,8-10")),
        ("scl", (None, "b.tif"), (None, "scl")),
        ("scl", ("a.tif", None), ("scl", None)),
    ],
)
def test_one_text_states_the_values_of_both_masks(
    values: str | None, masks: tuple[str | None, str | None], expected: tuple[str | None, ...]
) -> None:
    found = asked_masks(called(masks, values), "input")
    assert tuple(mask and mask.values for mask in found) == expected
    assert tuple(mask and mask.mask for mask in found) == masks


def test_no_mask_is_looked_for_where_none_is_wanted(tmp_path: Path) -> None:
    (tmp_path / "T32UQD_20200620T101031_SCL_20m.jp2").touch()
    images = (tmp_path / "T32UQD_20200620T101031_B04_20m.jp2",) * 2
    beside = asked_masks(called((None, None), None, images), "input")
    assert [mask is None for mask in beside] == [False, False]
    assert asked_masks(called((None, None), "none", images), "input") == (None, None)
    of_input = asked_masks(called((None, None), "none;", images), "input")
    assert [mask is None for mask in of_input] == [True, False]


@pytest.mark.parametrize(
    ("values", "masks", "message"),
    [
        ("scl", (None, None), "there is no mask that the values scl belong to"),
        ("1; 2; 3", ("a.tif", "b.tif"), "there are two masks, not 3"),
        ("1; scl", ("a.tif", None), "there is no mask that the values scl belong to"),
    ],
)
def test_values_without_a_mask_are_refused(
    values: str, masks: tuple[str | None, str | None], message: str
) -> None:
    with pytest.raises(ParameterError, match=message):
        asked_masks(called(masks, values), "input")


def called(
    masks: tuple[str | None, str | None],
    values: str | None,
    images: tuple[Path, Path] = (Path("r.tif"), Path("i.tif")),
) -> dict[str, object]:
    """Return the arguments of a tool's call."""
    return {
        "reference": images[0],
        "input": images[1],
        "reference_mask": masks[0],
        "input_mask": masks[1],
        "mask_values": values,
    }
