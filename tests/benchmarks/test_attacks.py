"""The red team: every attack's truth is what its images show, and what is wrong is counted so."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy import ndimage

from benchmarks.accuracy import CORRECT, INACCURATE, REFUSED, SILENTLY_WRONG
from benchmarks.attacks import cases as attack_cases
from benchmarks.attacks import ground, locked, parts, placement, repetition, suite
from benchmarks.attacks.cases import ATTACKS, AttackCase, cases, judge, named
from benchmarks.attacks.catalogue import CONTROLS, EXAMPLES, LOCKED, Attack, Setting
from benchmarks.attacks.effects import OF_THE_ARRAY
from benchmarks.attacks.overlays import OVERLAYS, Overlay
from benchmarks.attacks.pairs import Pair, Source, pixels
from benchmarks.attacks.scenes import Scene, scenes
from benchmarks.attacks.sensors import SensorCase
from benchmarks.suites import Settings
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import apply_affine

SIDE = 300


def texture(seed: int, length_px: float = 3.0) -> np.ndarray:
    """One band of bytes with smooth texture."""
    noise = np.random.default_rng(seed).normal(size=(SIDE, SIDE))
    smooth = cv2.GaussianBlur(noise, (0, 0), length_px)
    return np.clip(128 + 40 * smooth / smooth.std(), 1, 255).astype(np.uint8)[None]


@dataclass(frozen=True)
class Made(Scene):
    """A scene whose input is its reference, so that images are their own truth."""

    number: int = 0

    def source(self, seed: int, cache: Path) -> Source:
        image = texture(self.number)
        return Source(image, image, lambda px: px)


SCENES = (
    Made("made-rural", "optical-optical", number=1),
    Made("made-urban", "optical-optical", number=2),
    Made("made-suburban", "sar-optical", number=3),
    Made("made-city", "sar-optical", number=4),
)


def setting(seed: int = 1) -> Setting:
    return Setting(np.random.default_rng(seed), SCENES, seed, Path())


@pytest.fixture
def pair() -> Pair:
    return SCENES[0].pair(1, Path())


@pytest.fixture
def made_scenes(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(attack_cases, "all_scenes", lambda data: {s.name: s for s in SCENES})
    return


def agreement(pair: Pair) -> tuple[float, float]:
    """Share of the input whose truth is known, and the median difference of what it shows."""
    known = np.isfinite(pair.shown).all(axis=-1)
    at = np.nan_to_num(pair.shown, nan=-10).astype(np.float32)
    shown = cv2.remap(
        pair.reference[0], at[..., 0], at[..., 1], cv2.INTER_CUBIC, None, cv2.BORDER_CONSTANT
    )
    known &= (shown > 0) & (pair.input[0] > 0)
    off = np.abs(shown.astype(float) - pair.input[0])[known]
    return float(known.mean()), float(np.median(off)) if known.any() else math.inf


def names(attacks: list[Attack]) -> list[str]:
    return [f"{attack.name} {attack.variant}" for attack in attacks]


# Attacks whose grey values are those of the ground.
PLAIN = [
    *parts.ATTACKS,
    *(a for a in placement.ATTACKS if a.name not in ("mirrored", "another place")),
]


@pytest.mark.parametrize("attack", PLAIN, ids=names(PLAIN))
@pytest.mark.parametrize("seed", [1, 2])
def test_the_truth_is_what_the_input_shows(attack: Attack, seed: int, pair: Pair) -> None:
    made = attack.make(pair, setting(seed))
    share, off = agreement(made)
    assert share > 0.1
    # Grey values vary by 40; two interpolations and rounding by less than one.
    assert off <= 2.0
    # A truth that is another by a few pixels would not agree so.
    wrong = replace(made, shown=made.shown + 6.0)
    assert agreement(wrong)[1] > 10


@pytest.mark.parametrize("attack", PLAIN, ids=names(PLAIN))
def test_georeferencing_of_another_crs_or_size_leaves_the_truth(attack: Attack, pair: Pair) -> None:
    made = attack.make(pair, setting(3))
    assert made.shown.shape == (*made.input.shape[1:], 2)
    assert np.isfinite(made.shown).any()


@pytest.mark.parametrize("name", ["mirrored", "another place"])
def test_nothing_is_right_where_the_images_show_nothing_in_common(name: str, pair: Pair) -> None:
    attack = next(a for a in placement.ATTACKS if a.name == name)
    made = attack.make(pair, setting())
    assert made.errors_px(lambda xy: xy) == (math.inf, math.inf)
    assert judge("coregister", made, math.inf) == SILENTLY_WRONG
    assert judge("estimate_rotation", made, math.inf) == SILENTLY_WRONG


@pytest.mark.parametrize("name", [name for name in OVERLAYS if name not in OF_THE_ARRAY])
def test_what_is_locked_is_the_same_at_the_same_pixels(name: str, pair: Pair) -> None:
    drawn = OVERLAYS[name](pair.reference.shape[1:], np.random.default_rng(2))
    made = pair.moved(np.array([9.0, -12.0])).both(drawn.change())
    covered = (drawn.alpha >= 1) & (made.input[0] > 0)
    np.testing.assert_array_equal(made.reference[:, covered], made.input[:, covered])
    # Something is locked: images of other ground are more alike than without it.
    other = pair.changed(None, lambda image: texture(7)[:, : image.shape[1], : image.shape[2]])
    alike = [
        np.corrcoef(one.reference.ravel(), one.input.ravel())[0, 1]
        for one in (other, other.both(drawn.change()))
    ]
    assert alike[1] > alike[0] + 0.03


@pytest.mark.parametrize("name", OF_THE_ARRAY)
def test_effects_are_of_the_array(name: str, pair: Pair) -> None:
    change = OVERLAYS[name](pair.reference.shape[1:], np.random.default_rng(3)).change()
    once, again = change(pair.reference), change(pair.reference)
    np.testing.assert_array_equal(once, again)
    assert once.shape == pair.reference.shape
    assert np.mean(once != pair.reference) > 0.05


def test_an_overlay_can_be_blurred() -> None:
    """A box of one grey value keeps it and what it covers; its rims are as soft as asked for."""
    alpha = np.zeros((80, 80))
    alpha[20:60, 20:60] = 1.0
    soft = Overlay(200.0 * alpha, alpha).softer(2.0)
    assert soft.alpha.sum() == pytest.approx(alpha.sum(), rel=1e-6)
    assert soft.values[soft.alpha > 0.01] == pytest.approx(200.0, rel=1e-6)
    # The standard deviation of the rim's slope is that of the Gaussian.
    slope = np.diff(soft.alpha[40, :40])
    at = np.arange(39) + 0.5
    mean = (at * slope).sum()
    assert np.sqrt(((at - mean) ** 2 * slope).sum()) == pytest.approx(2.0, rel=0.05)


def test_an_overlay_can_be_moved(pair: Pair) -> None:
    drawn = OVERLAYS["labels"](pair.reference.shape[1:], np.random.default_rng(4))
    plain = np.full_like(pair.reference, 128)
    np.testing.assert_array_equal(
        drawn.change(5, -3)(plain), np.roll(drawn.change()(plain), (-3, 5), (1, 2))
    )


def transform_of(pair: Pair, right: float, down: float) -> Transform:
    """What a tool that finds one shift would return: input pixels of map positions."""
    to_px = ~pair.reference_transform
    return lambda xy: apply_affine(to_px, xy) - 0.5 + [right, down]


@pytest.mark.parametrize(("share", "error"), [(0.05, 0.0), (0.3, 10.0)])
def test_a_tenth_of_the_overlap_decides(pair: Pair, share: float, error: float) -> None:
    off = np.where(np.arange(pair.size[0]) > (1 - share) * pair.size[0], 10.0, 0.0)
    shift = np.zeros((*pair.input.shape[1:], 2))
    shift[..., 0] = off
    made = pair.moved(shift, "a part lies off")
    found, rmse = made.errors_px(transform_of(pair, 0, 0))
    assert found == pytest.approx(error, abs=1e-6)
    assert rmse == pytest.approx(10 * math.sqrt(share), rel=0.3)
    assert judge("coregister", made, found) == (SILENTLY_WRONG if error else CORRECT)


def test_the_right_shift_has_no_error_and_others_have_theirs(pair: Pair) -> None:
    made = pair.moved(np.array([7.25, -11.5]))
    assert made.errors_px(transform_of(made, 7.25, -11.5)) == pytest.approx((0, 0), abs=1e-6)
    assert made.errors_px(transform_of(made, 9.25, -11.5)) == pytest.approx((2, 2), abs=1e-6)
    assert judge("match_optical", made, 2.0) == INACCURATE
    for error, verdict in ((4.0, CORRECT), (5.9, INACCURATE), (6.1, SILENTLY_WRONG)):
        # 90 % of errors of a root mean square of 2 px lie within 3.03 px.
        assert judge("match_optical", replace(made, sigma_px=2.0), error) == verdict


def test_nodata_is_not_measured(pair: Pair) -> None:
    made = pair.moved(np.array([8.0, 0.0]))
    holes = np.zeros(pair.input.shape[1:], bool)
    holes[:, : pair.size[0] // 2] = True
    made = made.changed(None, lambda image: np.where(holes, 0, image))
    _, at = made.known()
    assert at[:, 0].min() >= pair.size[0] // 2 - 1


def test_controls_lie_where_they_say(pair: Pair) -> None:
    aligned = locked.aligned(OVERLAYS["labels"])(pair, setting())
    found, _ = aligned.errors_px(transform_of(aligned, 0, 0))
    assert found == pytest.approx(0, abs=1e-6)
    placed = locked.placed_right(OVERLAYS["labels"])(pair, setting())

    def nominal(xy: np.ndarray) -> np.ndarray:
        return apply_affine(~placed.input_transform, xy) - 0.5

    assert placed.errors_px(nominal)[0] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_ground_is_rotated_beneath_what_is_locked(seed: int, pair: Pair) -> None:
    drawn = OVERLAYS["labels"](pair.reference.shape[1:], np.random.default_rng(2))
    made = locked.rotated(lambda shape, rng: drawn)(pair, setting(seed))
    covered = (drawn.alpha >= 1) & (made.input[0] > 0)
    np.testing.assert_array_equal(made.reference[:, covered], made.input[:, covered])
    # The truth is what the input shows, and no shift comes near to it.
    bare = locked.rotated(lambda shape, rng: Overlay(np.zeros(shape), np.zeros(shape)))
    assert agreement(bare(pair, setting(seed)))[1] <= 2.0
    shown, at = made.known()
    off = at - shown
    assert made.errors_px(transform_of(made, *np.median(off, axis=0)))[0] > 6.0


def test_a_stretched_part_lies_farther_off_the_farther_from_its_seam(pair: Pair) -> None:
    made = parts.stretched(pair, setting(4))
    known = np.isfinite(made.shown).all(axis=-1)
    off = (pixels(made.size) - made.shown)[known]
    still = np.median(off, axis=0)
    away = np.hypot(*(off - still).T)
    # Most lies still, the rest off by any length up to the largest.
    assert 0.3 < np.mean(away < 0.01) < 0.95
    assert 7.0 < away.max() <= 25.0
    counts, _ = np.histogram(away[away > 0.01], bins=5)
    assert counts.min() > 0


@pytest.mark.parametrize(
    ("make", "sign"), [(ground.shadows_moved, -1), (ground.bright_sides_moved, 1)]
)
def test_sides_are_on_another_side_of_objects_that_stand_still(
    make: Callable[[Pair, Setting], Pair], sign: int
) -> None:
    flat = np.full((1, SIDE, SIDE), 150, np.uint8)
    seen = replace(SCENES[0].pair(1, Path()), source=Source(flat, flat, lambda px: px))
    seen = replace(seen, reference=flat[:, : seen.size[1], : seen.size[0]])
    made = make(seen, setting(2))
    known = ndimage.binary_erosion(made.input[0] > 0, np.ones((9, 9)))
    sides = [np.maximum(sign * (image[0] - 150.0), 0) for image in (made.reference, made.input)]
    at = np.nan_to_num(made.shown, nan=-10).astype(np.float32)

    def alike(right: int, down: int) -> float:
        offset = np.array([right, down], np.float32)
        moved = cv2.remap(sides[0], *np.moveaxis(at + offset, -1, 0), cv2.INTER_LINEAR)
        return float(np.corrcoef(moved[known], sides[1][known])[0, 1])

    # The sides, which are all that differs much, match some pixels beside the tops.
    places = range(-12, 13, 2)
    best = max((alike(x, y), x, y) for x in places for y in places)
    assert best[0] > alike(0, 0) + 0.1
    assert 2.0 <= np.hypot(*best[1:]) <= 12.0


def test_the_reference_in_a_band_is_the_reference(pair: Pair) -> None:
    made = ground.self_copy(pair, setting())
    assert made.input.shape[0] == 3
    assert sum(np.array_equal(band, made.reference[0]) for band in made.input) == 1


def test_images_of_one_speckle_filter_share_its_texture_over_displaced_ground() -> None:
    """Each date keeps its local mean, and takes the texture of all dates [Quegan2001]."""
    radar = Made("made-radar", "sar-sar", number=5).pair(1, Path())
    made = ground.filtered_stack(radar, setting())
    shift = pixels(made.size)[150, 150] - made.shown[150, 150]
    assert 5.0 <= np.hypot(*shift) <= 12.0
    # Without detail below the filter's window, the input shows the ground at its true place.
    coarse = replace(
        made,
        **{
            key: cv2.blur(getattr(made, key)[0].astype(float), (25, 25))[None]
            for key in ("reference", "input")
        },
    )
    at_truth = agreement(coarse)[1]
    nominal = np.where(np.isfinite(made.shown), pixels(made.size), np.nan)
    assert at_truth < 0.5 * agreement(replace(coarse, shown=nominal))[1]
    # The detail lies at the same pixels of both.
    held = ndimage.binary_erosion((made.input[0] > 0) & (made.reference[0] > 0), np.ones((25, 25)))
    fine = [
        np.log(image[0].astype(float)) - cv2.blur(np.log(image[0].astype(float)), (5, 5))
        for image in (np.maximum(made.reference, 1), np.maximum(made.input, 1))
    ]
    assert np.corrcoef(fine[0][held], fine[1][held])[0, 1] > 0.8


def test_fields_of_a_survey_grid_lie_half_a_mile_apart() -> None:
    """Roads follow every other line; a date sows other crops within the same borders."""
    quarter_px, at = 40.0, pixels((400, 300))
    (once, road), (again, same) = (
        repetition.survey_grid(at, quarter_px, np.random.default_rng(1), np.random.default_rng(n))
        for n in (2, 3)
    )
    np.testing.assert_array_equal(road, same)
    assert np.mean(once == again) < 0.01
    # Crops of two dates agree in where they change, not in brightness.
    assert abs(np.corrcoef(once.ravel(), again.ravel())[0, 1]) < 0.3
    edges = [np.abs(np.diff(image, axis=1)) > 0 for image in (once, again)]
    assert np.mean(edges[0] == edges[1]) > 0.99
    # The roads' mean profile repeats after a section, two quarters.
    profile = road.mean(axis=0) - road.mean()
    lags = [float(profile[:-lag] @ profile[lag:]) for lag in range(60, 101)]
    assert 60 + int(np.argmax(lags)) == pytest.approx(2 * quarter_px, abs=1)
    # Another place has another grid.
    other = repetition.survey_grid(
        at, quarter_px, np.random.default_rng(4), np.random.default_rng(2)
    )
    assert np.corrcoef(other[1].ravel(), road.ravel())[0, 1] < 0.5


def test_borders_of_fields_lie_where_the_truth_says(pair: Pair) -> None:
    made = repetition.fields(False)(pair, setting())
    assert made.reference_transform.a in (10.0, 15.0, 20.0, 30.0)
    known = ndimage.binary_erosion(made.input[0] > 0, np.ones((9, 9)))
    borders = [
        ndimage.gaussian_gradient_magnitude(image[0].astype(float), 1.0)
        for image in (made.reference, made.input)
    ]

    def alike(shown: np.ndarray) -> float:
        at = np.nan_to_num(shown, nan=-10).astype(np.float32)
        seen = cv2.remap(borders[0], at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        inside = known & (at > 5).all(axis=-1) & (at < np.array(made.size) - 6).all(axis=-1)
        return float(np.corrcoef(seen[inside], borders[1][inside])[0, 1])

    assert alike(made.shown) > alike(made.shown + 5.0) + 0.3
    assert np.isnan(repetition.fields(True)(pair, setting()).shown).all()


@pytest.mark.slow
@pytest.mark.usefixtures("made_scenes")
def test_cases_are_the_same_every_time_and_others_by_another_seed() -> None:
    every = cases(range(1, 3), Path(), Path())
    assert len({case.name for case in every}) == len(every)
    own = [case for case in every if isinstance(case, AttackCase)]
    others = 0
    for case in own[:: len(own) // 8]:
        once, again = case.make(), named(case.name, Path(), Path()).make()
        np.testing.assert_array_equal(once.input, again.input)
        np.testing.assert_array_equal(once.shown, again.shown)
        other = replace(case, seed=case.seed + 2).make()
        others += once.input.shape != other.input.shape or (once.input != other.input).any()
    # Where nothing is drawn, as in aligned controls, the same scene is the same.
    assert others >= 6


def test_large_scenes_are_others_of_the_same_names(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    every = scenes(data)
    monkeypatch.setattr(attack_cases, "all_scenes", lambda data: {s.name: s for s in every})
    large = [scene for scene in every if scene.is_large]
    usual = {scene.name: scene for scene in every if not scene.is_large}
    for scene in large:
        small = usual[scene.name.removesuffix("-large")]
        assert (scene.kind, scene.density) == (small.kind, small.density)
        assert scene.sides_px[0] > small.sides_px[1]
    drawn = [
        {case.scene for case in cases([1], data, data, large=is_large)}
        for is_large in (False, True)
    ]
    names = {scene.name for scene in large}
    assert drawn[1] and drawn[1] <= names and not drawn[0] & names


@pytest.mark.usefixtures("made_scenes")
def test_every_class_is_in_a_sample_and_every_tool_in_all() -> None:
    every = cases([1], Path(), Path())
    classes = {case.attack for case in every}
    assert {case.attack for case in suite.sample(every, len(classes))} == classes
    counts = Counter(case.attack for case in suite.sample(every, 2 * len(classes)))
    assert max(counts.values()) <= 3
    tools = {case.tool for case in every}
    assert tools >= {"coregister", "match_optical", "register", "estimate_rotation"}
    assert tools >= {"refine_rpc", "extract_gcps"}


def test_there_are_the_classes_of_the_issue_and_many_more() -> None:
    groups = Counter(attack.group for attack in ATTACKS)
    assert min(groups.values()) >= 1
    assert len({a.name for a in ATTACKS if a.group not in (CONTROLS, EXAMPLES)}) >= 50
    assert {a.variant for a in ATTACKS if a.group == LOCKED} >= {"displaced", "other place"}


@pytest.mark.parametrize("end", ["", "/-/made-rural/coregister", "/-/made-rural/coregister/x"])
def test_a_case_needs_its_whole_name(end: str) -> None:
    name = f"hill{end}"
    with pytest.raises(ValueError, match="no case"):
        named(name, Path(), Path())


def test_a_case_of_rpcs_has_a_name_like_others() -> None:
    case = named("RPCs, labels/-/sim-sensor/refine_rpc/4", Path(), Path())
    assert isinstance(case, SensorCase) and (case.tool, case.seed) == ("refine_rpc", 4)
    assert case.name == "RPCs, labels/-/sim-sensor/refine_rpc/4"


def settings(tmp_path: Path, **more: object) -> Settings:
    return replace(Settings(False, 1, 1, tmp_path, tmp_path), **more)


@pytest.mark.usefixtures("made_scenes")
def test_classes_are_chosen_by_their_names_or_those_of_their_groups(tmp_path: Path) -> None:
    chosen = suite.choose(settings(tmp_path, classes=("watermark", CONTROLS), first_seed=3))
    assert {case.seed for case in chosen} == {3}
    assert {case.group for case in chosen} == {LOCKED, CONTROLS}
    assert {case.attack for case in chosen if case.group == LOCKED} == {"watermark"}
    assert len(suite.choose(settings(tmp_path, sample=30))) == 30
    with pytest.raises(ValueError, match="no class 'waterfall'"):
        suite.choose(settings(tmp_path, classes=("waterfall",)))


@pytest.mark.slow
@pytest.mark.usefixtures("made_scenes")
def test_a_case_runs_alone_and_keeps_its_images(tmp_path: Path) -> None:
    name = "ground elsewhere/0/made-rural/coregister/1"
    result = suite.run(settings(tmp_path, named=(name,), save=tmp_path / "kept"))
    (record,) = result.records
    assert (record["name"], record["verdict"], record["group"]) == (name, CORRECT, CONTROLS)
    assert record["error_px"] < 0.3
    json.dumps(record, allow_nan=False)
    (folder,) = (tmp_path / "kept").iterdir()
    assert sorted(path.name for path in folder.iterdir()) == ["i.tif", "r.tif"]


@pytest.mark.slow
@pytest.mark.usefixtures("made_scenes")
def test_another_place_is_refused_by_a_rule(tmp_path: Path) -> None:
    result = suite.run(settings(tmp_path, named=("another place/-/made-rural/match_optical/1",)))
    (record,) = result.records
    assert record["verdict"] == REFUSED
    assert record["rule"]
    tables = {table.title: table.rows for table in result.tables}
    assert tables["Rules that refused"] == [[record["rule"], "1", "0"]]
    assert tables["Silently wrong"] == []
