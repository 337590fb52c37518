"""Facts about the images of a pair: determined when first needed, and only once."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from canopies import draw_country
from evidences import facts, scene
from facts_of_pairs import FIELDS, TOWN, grey_values, opened, speckled
from textured_pairs import shift_on_map

from groundtie.kinds import AUTO
from groundtie.masks.used import INPUT, REFERENCE
from groundtie.matching.shared_content import Sensors
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration import scene as scene_module
from groundtie.registration.scene import SceneInfo
from groundtie.registration.specification import BOTH, NEITHER


@pytest.mark.parametrize(
    ("reference", "input", "expected"),
    [
        (TOWN, FIELDS, True),
        (FIELDS, TOWN, True),
        (FIELDS, FIELDS, False),
        (grey_values(0.1, 0.01), FIELDS, True),
        (grey_values(0.06, 0.01), FIELDS, False),
        # Speckle identifies the radar image, whatever the camera image shows.
        (speckled(0.02), TOWN, False),
        (speckled(0.1), FIELDS, True),
        (speckled(0.25), speckled(0.25), False),
    ],
)
def test_what_is_bright_may_be_a_town(
    tmp_path: Path, reference: np.ndarray, input: np.ndarray, expected: bool
) -> None:
    with opened(tmp_path, reference, input) as pair:
        assert SceneInfo.of(pair).may_be_town == expected


def test_open_ground_is_looked_for_where_the_radar_image_shows_it(tmp_path: Path) -> None:
    """In the reference, or in the input where a model places it; not in camera images."""
    forest = draw_country(300, 0.4)
    radar, camera = forest.seen(0, 2.0, 1), grey_values(0.02, 0.01)[:300, :300]
    # The map's y axis points up.
    model, moved = shift_on_map(25.0, -10.0), (25, 10)
    with opened(tmp_path, radar, camera) as pair:
        info = SceneInfo.of(pair, REFERENCE)
        ground, piece = info.kinds_by(model).open_ground, pair.grid.window(90, 60, 70, 50)
        assert ground is not None
        assert np.array_equal(ground(piece), info.reference.open_ground(piece))
    with opened(tmp_path, camera, radar) as pair:
        info = SceneInfo.of(pair, INPUT)
        ground, piece = info.kinds_by(model).open_ground, pair.grid.window(90, 60, 70, 50)
        assert ground is not None
        there = pair.grid.window(90 + moved[0], 60 + moved[1], 70, 50)
        assert 0.1 < ground(piece).mean() < 0.9
        assert np.array_equal(ground(piece), info.input.open_ground(there))
        assert SceneInfo.of(pair, NEITHER).kinds_by(model).open_ground is None


def test_a_radar_image_whose_speckle_was_averaged_may_have_canopies() -> None:
    """By resampling to degrees, say; two camera images of little noise have none."""
    averaged, camera, model = facts(0.03), facts(0.0005), shift_on_map(0.0, 0.0)
    assert scene(averaged, camera).sensors is Sensors.CAMERAS
    assert scene(averaged, camera).kinds_by(model).open_ground is not None
    assert scene(camera, camera).kinds_by(model).open_ground is None


def test_whoever_names_the_radar_image_is_believed(tmp_path: Path) -> None:
    with opened(tmp_path, TOWN, FIELDS) as pair:
        for declared, is_town in ((REFERENCE, True), (INPUT, False)):
            info = SceneInfo.of(pair, declared)
            assert info.sensors is Sensors.DIFFERENT and info.radar_name == declared
            assert info.may_be_town == is_town
            assert info.radar is getattr(info, declared) and info.other is not info.radar
        assert SceneInfo.of(pair).sensors is not Sensors.DIFFERENT
        # Neither of two camera images is a radar image.
        assert not SceneInfo.of(pair, "neither").may_be_town


@pytest.mark.parametrize(
    ("reference", "declared", "expected"),
    [
        # Declared a radar image, without speckle.
        (TOWN, REFERENCE, True),
        (TOWN, "auto", False),
        (FIELDS, REFERENCE, False),
        (speckled(0.25), "auto", False),
    ],
)
def test_the_ground_of_a_town_is_found_by_its_speckle(
    tmp_path: Path, reference: np.ndarray, declared: str, expected: bool
) -> None:
    with opened(tmp_path, reference, FIELDS) as pair:
        assert SceneInfo.of(pair, declared).is_despeckled_town == expected


@pytest.mark.parametrize(
    ("reference", "pixel_m", "has_crs", "expected"),
    [
        (speckled(0.25), None, False, True),
        (speckled(0.25), 1.0, False, True),
        (speckled(0.25), 10.0, True, False),
        (speckled(0.02), None, False, False),
    ],
)
def test_the_ground_of_a_town_is_found_by_its_pixel_size(
    tmp_path: Path, reference: np.ndarray, pixel_m: float | None, has_crs: bool, expected: bool
) -> None:
    with opened(tmp_path, reference, FIELDS, pixel_m=pixel_m, has_crs=has_crs) as pair:
        info = SceneInfo.of(pair)
        assert info.is_town_of_unknown_size == expected
        assert not replace(info, has_user_mask=True).is_town_of_unknown_size


@pytest.mark.parametrize(
    ("strong_share", "expected"),
    [(0.079, (False, False)), (0.081, (False, True)), (0.111, (True, True))],
)
def test_towns_are_where_strong_scatterers_stand(
    strong_share: float, expected: tuple[bool, bool]
) -> None:
    info = SceneInfo(facts(is_known_radar=True, strong_share=strong_share), facts())
    assert (info.is_town, info.may_be_town) == expected


@pytest.mark.parametrize(
    ("rough", "smooth", "is_known", "expected"),
    [
        # Speckle, or what a layer of half opacity leaves of it, beside a camera's noise.
        (0.06, 0.006, False, True),
        (0.013, 0.001, False, True),
        (0.012, 0.001, False, False),
        (0.02, 0.01, False, False),
        (0.02, 0.01, True, True),
    ],
)
def test_a_layer_may_hide_that_images_are_of_two_sensors(
    rough: float, smooth: float, is_known: bool, expected: bool
) -> None:
    info = SceneInfo(facts(rough, is_known_radar=is_known), facts(smooth))
    assert info.may_be_different == expected
    assert replace(info, declared="reference").may_be_different
    both = replace(info, input=facts(smooth, is_known_radar=True))
    assert replace(both, reference=facts(rough, is_known_radar=True)).may_be_different is False
    for declared in (BOTH, NEITHER):
        assert not replace(info, declared=declared).may_be_different


def test_a_users_mask_needs_no_speckle() -> None:
    town = facts(is_known_radar=True, strong_share=0.25)
    for has_mask in (False, True):
        info = SceneInfo(town, facts(), has_user_mask=has_mask)
        assert info.is_despeckled_town != has_mask


@pytest.mark.parametrize("mean_db", [-45.0, -12.0, 5.0])
def test_decibels_show_what_amplitudes_show(tmp_path: Path, mean_db: float) -> None:
    town = speckled(0.25)
    folder = tmp_path / "decibels"
    folder.mkdir()
    decibels = 20 * np.log10(np.maximum(town / town.mean(), 10 ** (-15 / 20))) + mean_db
    with opened(tmp_path, town, FIELDS) as pair, opened(folder, decibels, FIELDS) as other:
        found, known = SceneInfo.of(other), SceneInfo.of(pair)
        for one in (found, known):
            assert one.is_town and one.radar_name == REFERENCE
        assert found.radar.strong_share == pytest.approx(known.radar.strong_share, abs=0.01)
        assert found.radar.variation2 == pytest.approx(known.radar.variation2, rel=0.05)


@pytest.mark.parametrize(("mean", "deviation"), [(0.0, 1.0), (-0.3, 0.2), (0.0, 50.0), (0.0, 0.01)])
def test_other_negative_values_show_no_radar(tmp_path: Path, mean: float, deviation: float) -> None:
    """As of indices and standardised images."""
    standard = (FIELDS - FIELDS.mean()) / FIELDS.std() * deviation + mean
    with opened(tmp_path, standard, FIELDS) as pair:
        info = SceneInfo.of(pair)
        assert info.apparent is Sensors.CAMERAS
        assert not info.is_town


@pytest.mark.parametrize("looks", [1, 4, 20])
def test_speckle_shows_which_is_the_radars(tmp_path: Path, looks: int) -> None:
    random = np.random.default_rng(0)
    ground = np.kron(random.uniform(20, 200, (25, 25)), np.ones((8, 8)))
    radar = ground * np.sqrt(random.gamma(looks, 1 / looks, ground.shape))
    camera = ground + random.normal(0, 3, ground.shape)
    with opened(tmp_path, radar, camera) as pair:
        one_way = SceneInfo.of(pair)
        # In both orders.
        other_way = SceneInfo(one_way.input, one_way.reference)
        twice = SceneInfo(one_way.reference, one_way.reference)
        assert (one_way.radar_name, other_way.radar_name) == (REFERENCE, INPUT)
        for info in (one_way, other_way):
            # Twenty looks are as homogeneous as the grain of a camera image.
            assert (info.sensors is Sensors.DIFFERENT) == (looks < 20)
            assert info.sensors is not Sensors.RADARS
        assert (twice.sensors is Sensors.RADARS) == (looks < 20)
        appears = Sensors.DIFFERENT if looks < 20 else Sensors.CAMERAS
        for info, declared, expected in (
            # A mask uses the declaration of one image, whatever the other is.
            (twice, REFERENCE, Sensors.RADARS if looks < 20 else Sensors.DIFFERENT),
            (one_way, REFERENCE, Sensors.DIFFERENT),
            (one_way, BOTH, Sensors.RADARS),
            (twice, NEITHER, Sensors.CAMERAS),
            (one_way, NEITHER, Sensors.CAMERAS),
        ):
            assert replace(info, declared=declared).sensors is expected
        for declared in (BOTH, NEITHER):
            assert replace(one_way, declared=declared).apparent is appears


def test_two_rough_images_are_tested_for_layover_whatever_their_units() -> None:
    """Power varies far more than amplitude; both are searched for towns."""
    both = scene(facts(variation2=5.0, strong_share=0.25), facts(variation2=0.2))
    for declared in (AUTO, REFERENCE, BOTH):
        assert replace(both, declared=declared).sensors is Sensors.RADARS
    assert both.apparent is Sensors.DIFFERENT
    assert both.is_town and not both.may_be_town
    assert replace(both, declared=NEITHER).are_both_rough


def test_metadata_count_before_speckle(tmp_path: Path) -> None:
    """The filtered image is the more homogeneous one."""
    random = np.random.default_rng(0)
    filtered = np.full((100, 100), 50) + random.normal(0, 0.1, (100, 100))
    camera = np.full((100, 100), 50) + random.normal(0, 2, (100, 100))
    radar = 50 * np.sqrt(random.gamma(2, 1 / 2, (100, 100)))
    with opened(tmp_path, filtered, camera, filtered=(REFERENCE,)) as pair:
        info = SceneInfo.of(pair)
        assert info.reference.variation2 < info.input.variation2
        assert info.radar_name == REFERENCE
        assert info.sensors is Sensors.DIFFERENT
        swapped = SceneInfo(info.input, info.reference)
        assert swapped.radar_name == INPUT and swapped.sensors is Sensors.DIFFERENT
    # Two radar images, one of them filtered: neither is a camera image.
    with opened(tmp_path, filtered, radar, filtered=(REFERENCE,)) as pair:
        info = SceneInfo.of(pair)
        pairs = [(info.reference, info.input), (info.input, info.reference)]
        for one, other in [*pairs, (info.reference, info.reference)]:
            both = SceneInfo(one, other)
            assert both.sensors is Sensors.RADARS


def test_facts_are_found_when_asked_for_and_never_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    for name in ("variation2_of", "share_of_strong_scatterers", "is_known_radar"):
        found = getattr(scene_module, name)

        def counted(*of: object, name: str = name, found: object = found) -> object:
            asked.append(name)
            return found(*of)  # type: ignore[operator]

        monkeypatch.setattr(scene_module, name, counted)
    with opened(tmp_path, speckled(0.25), FIELDS) as pair:
        info = SceneInfo.of(pair)
        assert asked == [] and info.summary() == {} and info.facts() == {}
        for _ in range(2):
            assert info.sensors is Sensors.DIFFERENT and info.is_town and info.may_be_town
            assert not info.is_despeckled_town
    # Of both images; bright areas of the camera image do not matter.
    assert sorted(asked) == sorted(
        ["variation2_of"] * 2 + ["is_known_radar"] * 2 + ["share_of_strong_scatterers"]
    )
    assert asked.count("share_of_strong_scatterers") == 1


def test_a_summary_is_json_and_facts_are_for_people() -> None:
    info = scene(facts(variation2=0.25, strong_share=0.25))
    assert info.sensors is Sensors.DIFFERENT
    summary = json.loads(json.dumps(info.summary()))
    assert summary["reference"] == {
        "is_known_radar": False,
        "variation2": 0.25,
        "strong_share": 0.25,
    }
    assert summary["sensors"] == "radar and camera"
    assert info.facts() == {
        "radar image": "reference",
        "coefficient of variation": "0.50 in the most homogeneous windows",
        "strong scatterers": "25% of the radar image",
    }
    both = scene(facts(variation2=0.25), facts(variation2=0.2))
    assert both.sensors is Sensors.RADARS
    assert both.facts() == {"images": "both are a radar's"}


def test_the_radar_image_of_every_real_pair_is_found(real_data: Path) -> None:
    cases = json.loads((real_data / "cases.json").read_text())
    pairs = [case for case in cases if case["kind"].startswith("sar-optical")]
    assert len(pairs) >= 10
    for case in pairs:
        with ExitStack() as stack:
            radar, camera = (
                Image(
                    stack.enter_context(
                        open_raster(real_data / case[which], allow_sensor_geometry=True)
                    )
                )
                for which in ("reference", "input")
            )
            info = SceneInfo.of(make_pair(radar, camera))
            assert info.radar_name == REFERENCE, case["id"]
