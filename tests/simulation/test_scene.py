from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from groundtie.errors import ParameterError
from groundtie.simulation.cover import Cover
from groundtie.simulation.scene import (
    DENSITY_NAMES,
    SceneOptions,
    generate_scenes,
)

SMALL = SceneOptions(size_px=(320, 280), seed=4)


class TestOptions:
    @pytest.mark.parametrize(
        "change",
        [
            {"size_px": (8, 100)},
            {"density": "village"},
            {"pixel_size_m": 0.0},
            {"relief_m": -1.0},
            {"changed": 1.5},
        ],
        ids=lambda change: next(iter(change)),
    )
    def test_refuses_what_cannot_be(self, change: dict) -> None:
        with pytest.raises(ParameterError):
            replace(SMALL, **change)


class TestShape:
    def test_size_is_width_by_height_plus_margins(self) -> None:
        scene = generate_scenes(SMALL, margin_px=10).radar
        for layer in (scene.terrain_m, scene.object_m, scene.parcel):
            assert layer.shape == (300, 340)

    def test_window_leaves_the_margin_out(self) -> None:
        scene = generate_scenes(SMALL, margin_px=10).radar
        assert scene.terrain_m[scene.window].shape == (280, 320)

    def test_window_of_a_scene_without_margin_is_everything(self) -> None:
        scene = generate_scenes(SMALL).radar
        assert scene.terrain_m[scene.window].shape == scene.terrain_m.shape

    def test_cover_of_some_rows(self) -> None:
        scene = generate_scenes(SMALL).radar
        assert np.array_equal(scene.cover(slice(20, 30)), scene.cover()[20:30])


class TestHeights:
    def test_flat_when_no_relief_is_wanted(self) -> None:
        assert not generate_scenes(replace(SMALL, relief_m=0)).radar.terrain_m.any()

    @pytest.mark.slow
    @pytest.mark.parametrize("relief_m", [20.0, 80.0])
    def test_terrain_range_and_slope(self, relief_m: float) -> None:
        options = SceneOptions((750, 750), pixel_size_m=8.0, relief_m=relief_m, seed=1)
        terrain = generate_scenes(options).radar.terrain_m
        assert 0.6 * relief_m < np.ptp(terrain) < 2.2 * relief_m
        slope = np.hypot(*np.gradient(terrain, options.pixel_size_m))
        assert np.degrees(np.arctan(slope.max())) < 25

    def test_roofs_are_flat_and_as_high_as_their_parcel(self) -> None:
        scene = generate_scenes(replace(SMALL, density="urban")).radar
        built = scene.cover() == Cover.BUILDING
        assert built.any()
        assert np.array_equal(scene.object_m[built], scene.parcels.height_m[scene.parcel[built]])

    def test_canopies_are_uneven_and_below_their_height(self) -> None:
        scene = generate_scenes(SceneOptions((600, 600), density="rural", seed=1)).radar
        wood = scene.cover() == Cover.FOREST
        assert wood.any()
        top = scene.parcels.height_m[scene.parcel[wood]]
        assert np.all(scene.object_m[wood] <= top)
        assert 0.02 < (scene.object_m[wood] / top).std() < 0.2

    def test_nothing_stands_on_open_ground(self) -> None:
        scene = generate_scenes(SMALL).radar
        standing = np.isin(scene.cover(), (Cover.BUILDING, Cover.FOREST))
        assert not scene.object_m[~standing].any()


class TestChanges:
    @pytest.mark.parametrize("density", ["suburban", "urban"])
    def test_buildings_are_pulled_down_and_put_up(self, density: str) -> None:
        options = SceneOptions((600, 600), density=density, seed=2)
        before, after = generate_scenes(replace(options, changed=0.3))
        radar, camera = (
            set(np.unique(s.parcel[s.cover() == Cover.BUILDING])) for s in (before, after)
        )
        for only in (radar - camera, camera - radar):
            assert len(only) / len(radar | camera) == pytest.approx(0.15, abs=0.07)
        assert before.terrain_m is after.terrain_m
        assert not after.object_m[after.cover() == Cover.ROAD].any()

    @pytest.mark.parametrize("density", ["rural", "suburban", "urban"])
    def test_nothing_changes_unless_it_is_wanted(self, density: str) -> None:
        before, after = generate_scenes(replace(SMALL, density=density))
        assert after is before

    @pytest.mark.parametrize("density", DENSITY_NAMES)
    def test_nothing_is_higher_than_said(self, density: str) -> None:
        options = SceneOptions((400, 400), density=density, seed=1)
        assert generate_scenes(options).radar.object_m.max() <= options.highest_object_m


class TestReproducible:
    def test_same_options_same_scene(self) -> None:
        first, second = generate_scenes(SMALL, 5).radar, generate_scenes(SMALL, 5).radar
        assert np.array_equal(first.parcel, second.parcel)
        assert np.array_equal(first.terrain_m, second.terrain_m)
        assert np.array_equal(first.object_m, second.object_m)

    def test_seed_changes_everything(self) -> None:
        first, second = generate_scenes(SMALL).radar, generate_scenes(replace(SMALL, seed=5)).radar
        assert not np.array_equal(first.parcel, second.parcel)
        assert not np.array_equal(first.terrain_m, second.terrain_m)


def test_fields_of_coarse_images_are_larger_than_a_pixel() -> None:
    scene = generate_scenes(
        SceneOptions((300, 300), pixel_size_m=10.0, density="rural", seed=2)
    ).radar
    labels = scene.parcel[scene.cover() == Cover.FIELD]
    _, sizes = np.unique(labels, return_counts=True)
    assert np.median(sizes) > 400
