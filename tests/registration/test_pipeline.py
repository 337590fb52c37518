"""One pipeline: its stages, facts that are found once, and all rules applied to every tool."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from canopies import forest_files
from contexts import context
from facts_of_pairs import TOWN, grey_values, opened, speckled
from rpc_scenes import Scene, make_scene
from speckled_pairs import write_speckled_pair
from textured_pairs import (
    TexturedPair,
    error_px,
    pixels,
    rewritten,
    shift_on_map,
    write_textured_pair,
)

import groundtie
from groundtie.context import Context
from groundtie.errors import NothingFoundError, NotRegisteredError
from groundtie.features.detectors import SiftDetector, SiftOctDetector
from groundtie.geometry.models import Model
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.keypoint_fit import GuidedFit, KeypointFit
from groundtie.matching.pooled import PooledHistogramMatcher
from groundtie.matching.surface_fit import SurfaceFit
from groundtie.progress import Progress
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration import masks, verdict
from groundtie.registration import scene as scene_module
from groundtie.registration import stages as stages_module
from groundtie.registration.evidence import (
    AGREEMENT,
    ERROR,
    IMAGES,
    REFINEMENT,
    SCENE,
    SEARCH,
    SURVEY,
    RegistrationEvidence,
)
from groundtie.registration.masks import Masked
from groundtie.registration.opening import open_pair
from groundtie.registration.pipeline import mask_pair, run
from groundtie.registration.registration import Registration
from groundtie.registration.rules import RULES, Rule
from groundtie.registration.scene import SceneInfo
from groundtie.registration.specification import (
    COREGISTER,
    MATCHERS,
    OPTICAL,
    SAR_SAR,
    Specification,
)
from groundtie.registration.stages import Stages

__all__ = ["context"]
PRESETS = {"coregister": COREGISTER, "match_sar_sar": SAR_SAR, "match_optical": OPTICAL}


@pytest.mark.slow
def test_a_registration_has_a_transform_points_and_a_verdict(
    registration: Registration, textured: TexturedPair
) -> None:
    assert registration.verdict.accepted
    points, transform = registration.tie_points, registration.accepted_transform()
    assert points is not None
    assert error_px(transform, textured) < 0.3
    # Points of the fit first, then check points.
    assert (np.diff(points.is_check.astype(int)) >= 0).all()
    assert points.is_check.sum() == registration.verdict.check_points
    # No check point lies on pixels that the fit saw.
    px = textured.grid.map_to_pixel(points.reference_xy)
    masked = Masked(registration.pair, registration.scene, registration.mask)
    stages = Stages.of(registration.pair, masked, registration.spec)
    held_out = stages.held_out.layout.held_out(*px.T)
    np.testing.assert_array_equal(held_out, points.is_check)


def nothing_found(*_: object) -> Model:
    raise NothingFoundError("nothing in common was found")


def test_where_nothing_is_found_the_registration_has_a_verdict_alone(
    textured: TexturedPair, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stages_module, "find_coarse_model", nothing_found)
    with open_pair(textured.reference, textured.input, COREGISTER, context) as pair:
        found = run(pair, COREGISTER, context)
    assert not found.verdict.accepted and found.verdict.rule == "nothing in common"
    assert found.transform is None and found.tie_points is None


NEAR_M, FAR_M = (-53.0, 44.0), (-203.0, 157.0)


@pytest.mark.parametrize(
    ("shift_m", "is_placed", "is_found"),
    [(NEAR_M, True, True), (FAR_M, True, False), (FAR_M, False, True)],
)
@pytest.mark.slow
def test_images_that_are_placed_are_matched_from_there_alone(
    tmp_path: Path,
    context: Context,
    shift_m: tuple[float, float],
    is_placed: bool,
    is_found: bool,
) -> None:
    files = write_textured_pair(tmp_path, (260, 240), shift_on_map(*shift_m))
    asked = replace(COREGISTER, model="translation", search_radius_m=300.0, is_placed=is_placed)
    with open_pair(files.reference, files.input, asked, context) as pair:
        found = run(pair, asked, context)
    assert found.verdict.accepted == is_found
    assert not is_found or error_px(found.accepted_transform(), files) < 0.3
    survey = None if found.evidence is None else found.evidence.surveys.whole
    assert (survey is None) == is_placed


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return a radar and a camera image of a dense town."""
    folder = tmp_path_factory.mktemp("town")
    with opened(folder, speckled(0.25), TOWN):
        return folder / "reference.tif", folder / "input.tif"


def counting(monkeypatch: pytest.MonkeyPatch) -> Counter[tuple[str, object]]:
    """Count from now on how often each fact of each image is determined."""
    found: Counter[tuple[str, object]] = Counter()
    keys: dict[str, tuple[Any, Callable[[Any], object]]] = {
        "variation2_of": (scene_module, lambda image: image.source.path),
        "share_of_strong_scatterers": (scene_module, lambda scene: scene.like.path),
        "is_known_radar": (scene_module, lambda source: source.path),
        "find_ground": (masks, lambda scene: scene.like.path),
    }
    for name, (module, key) in keys.items():
        function = getattr(module, name)

        def counted(
            of: Any,
            *more: Any,
            name: str = name,
            key: Callable[[Any], object] = key,
            function: Callable[..., Any] = function,
            **named: Any,
        ) -> Any:
            found[name, key(of)] += 1
            return function(of, *more, **named)

        monkeypatch.setattr(module, name, counted)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("tool", PRESETS)
def test_each_fact_about_an_image_is_found_once(
    town: tuple[Path, Path], context: Context, monkeypatch: pytest.MonkeyPatch, tool: str
) -> None:
    spec = PRESETS[tool]
    found = counting(monkeypatch)
    with open_pair(*town, spec, context) as pair:
        result = run(pair, spec, context)
        assert max(found.values()) == 1
        if tool == "coregister":
            # The radar image's share and ground; the camera's brightness is never needed.
            counts = Counter(name for name, _ in found)
            assert counts["variation2_of"] == 2
            assert counts["share_of_strong_scatterers"] == 1
            assert counts["find_ground"] == 1
        before = found.copy()
        # Reports and summaries do not read anything again.
        result.summary()
        result.scene.facts()
        assert found == before


def test_a_towns_ground_is_found_once_and_matched_by_one_joint_histogram(
    town: tuple[Path, Path], context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = counting(monkeypatch)
    with open_pair(*town, COREGISTER, context) as pair:
        scene = SceneInfo.of(pair.pair, COREGISTER.radar)
        masked = mask_pair(pair, COREGISTER, context, scene)
        assert masked.used.kind == "ground" and masked.used.leaves_little
        assert Counter(name for name, _ in found)["find_ground"] == 1
        stages = Stages.of(pair.images, masked, COREGISTER)
        assert isinstance(stages.matcher, PooledHistogramMatcher)


@pytest.mark.slow
def test_what_may_be_a_town_in_large_pixels_is_not_tried_by_its_ground(
    tmp_path: Path, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = grey_values(0.25, 0.01, seed=5)
    for pixel_m, times in ((3.0, 1), (4.0, 0)):
        with opened(tmp_path, speckled(0.08), other, pixel_m=pixel_m):
            found = counting(monkeypatch)
            images = tmp_path / "reference.tif", tmp_path / "input.tif"
        with open_pair(*images, COREGISTER, context) as pair:
            result = run(pair, COREGISTER, context)
        assert not result.verdict.accepted and result.scene.may_be_town
        assert Counter(name for name, _ in found)["find_ground"] == times
        assert result.spec.tries == 1 + times


def test_matchers_are_put_together_by_name(textured: TexturedPair, context: Context) -> None:
    fits = dict(zip(MATCHERS, (SurfaceFit, KeypointFit, GuidedFit), strict=True))
    for name, kind in fits.items():
        spec = Specification(name)
        with open_pair(textured.reference, textured.input, spec, context) as pair:
            masked = mask_pair(pair, spec, context, SceneInfo.of(pair.pair))
            stages = Stages.of(pair.images, masked, spec)
            assert isinstance(stages.fit, kind)
            if not isinstance(stages.fit, SurfaceFit):
                # Radar images are matched without the octave of their speckle.
                is_radar = isinstance(stages.fit, KeypointFit)
                detector = SiftOctDetector(0.03) if is_radar else SiftDetector(0.03)
                assert stages.fit.matcher.detector == detector
            assert isinstance(stages.matcher, ChipMatcher)
            # No stage sees held-out pixels.
            assert stages.matcher.held_out is stages.held_out


@pytest.mark.slow
def test_tries_count_against_agreement_by_chance(textured: TexturedPair, context: Context) -> None:
    spec = replace(COREGISTER, tries=100)
    with open_pair(textured.reference, textured.input, spec, context) as pair:
        scene = SceneInfo.of(pair.pair)
        masked = mask_pair(pair, spec, context, scene)
        stages = Stages.of(pair.images, masked, spec)
        found = run(pair, spec, context)
        assert found.evidence is not None and found.check is not None
        surveys = stages.survey(found.evidence.estimate, context)
        evidence = stages.evidence(found.evidence.estimate, found.check, surveys)
        once = replace(evidence, tries=1).held_out.log10_chance
        assert evidence.held_out.log10_chance == pytest.approx(once + 2.0)
        assert found.verdict.log10_chance == pytest.approx(once + 2.0)
        assert evidence.scene is scene


@pytest.fixture(scope="module")
def radars(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    """Return two radar images of one place."""
    folder = tmp_path_factory.mktemp("radars")
    return write_speckled_pair(folder, (300, 280), shift_on_map(60.0, -45.0))


def name_of(stage: str) -> str:
    return f"house rule at {stage}"


@dataclass
class HouseRules:
    """Rules of stages that record every call; those of the last stage refuse."""

    stages: tuple[str, ...]
    is_final: bool = True
    asked: list[str] = field(default_factory=list)

    def rules(self) -> dict[str, tuple[Rule, ...]]:
        return {stage: (self.rule(stage),) for stage in self.stages}

    def rule(self, stage: str) -> Rule:
        ask = partial(self.ask, stage)
        return Rule(name_of(stage), "all", "this test", "go", ask, self.is_final)

    def ask(self, stage: str, _: object) -> str | None:
        self.asked.append(stage)
        return "forbidden" if stage == self.stages[-1] else None


def refused_by_house_rules(
    monkeypatch: pytest.MonkeyPatch,
    stages: tuple[str, ...],
    call: Callable[[], object],
    is_final: bool = True,
) -> list[str]:
    """Return the stages whose rules are asked, up to the last stage, which refuses."""
    house = HouseRules(stages, is_final)
    monkeypatch.setattr(verdict, "RULES", house.rules())
    if stages[-1] == SEARCH:
        monkeypatch.setattr(stages_module, "find_coarse_model", nothing_found)
    with pytest.raises(NotRegisteredError, match="forbidden; go") as error:
        call()
    assert error.value.verdict is not None
    assert error.value.verdict.rule == name_of(stages[-1])
    return house.asked


INSPECTED, SEARCHED = (IMAGES,), (IMAGES, SEARCH)
# The images are judged before anything is matched, and as part of the evidence.
CHECKED = (IMAGES, IMAGES, AGREEMENT, ERROR, SCENE, SURVEY)


@pytest.mark.slow
@pytest.mark.parametrize("tool", [*PRESETS, "register"])
@pytest.mark.parametrize(
    "stages", [INSPECTED, SEARCHED, CHECKED], ids=["images", "search", "check"]
)
def test_every_tool_is_judged_by_the_rules_of_every_stage(
    textured: TexturedPair,
    radars: TexturedPair,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    tool: str,
    stages: tuple[str, ...],
) -> None:
    files = radars if tool == "match_sar_sar" else textured
    output = tmp_path / "out.tif"

    def call() -> object:
        return getattr(groundtie, tool)(files.reference, files.input, output)

    asked = refused_by_house_rules(monkeypatch, stages, call, is_final=tool != "register")
    # One tool makes more than one attempt.
    assert asked == list(stages) * (len(asked) // len(stages))
    assert (len(asked) > len(stages)) == (tool == "register")
    assert not output.exists()


@pytest.mark.parametrize(
    ("rule", "is_final"),
    [
        ("uncertain transform", False),
        ("ground elsewhere", False),
        ("few points on the ground", True),
        ("part elsewhere", True),
        ("second place nearby", True),
        ("pixel-locked content", True),
        ("ground not found", True),
        ("second place", True),
    ],
)
def test_what_heights_may_cause_is_not_final(rule: str, is_final: bool) -> None:
    assert [r.is_final for r in chain.from_iterable(RULES.values()) if r.name == rule] == [is_final]


@pytest.mark.slow
@pytest.mark.parametrize(("is_final", "tries"), [(False, 2), (True, 1)])
def test_radar_images_are_tried_by_their_ground_after_what_is_not_final(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_final: bool, tries: int
) -> None:
    house = HouseRules((AGREEMENT,), is_final)
    monkeypatch.setattr(verdict, "RULES", house.rules())
    with pytest.raises(NotRegisteredError, match="forbidden"):
        groundtie.match_sar_sar(*forest_files(tmp_path, 0.3, seed=1))
    assert house.asked == [AGREEMENT] * tries


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return make_scene(tmp_path_factory.mktemp("sensor"), None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tool", "stages", "expected"),
    [
        ("extract_gcps", INSPECTED, INSPECTED),
        ("refine_rpc", INSPECTED, INSPECTED),
        ("extract_gcps", SEARCHED, SEARCHED),
        ("refine_rpc", SEARCHED, SEARCHED),
        # The images are judged again at the coarse shift.
        ("extract_gcps", CHECKED, (IMAGES, *CHECKED)),
        # First on the ground control, then on the result.
        (
            "refine_rpc",
            (*CHECKED[:4], REFINEMENT),
            (IMAGES, *CHECKED[:4], *CHECKED[2:4], REFINEMENT),
        ),
    ],
)
def test_ground_control_is_judged_by_the_rules_of_every_stage(
    sensor: Scene,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    tool: str,
    stages: tuple[str, ...],
    expected: tuple[str, ...],
) -> None:
    output = tmp_path / ("gcps.csv" if tool == "extract_gcps" else "refined_RPC.TXT")

    def call() -> object:
        return getattr(groundtie, tool)(
            image=sensor.image,
            reference=sensor.reference,
            dem=sensor.dem,
            dem_datum="ellipsoidal",
            matching_pixel_size=2.0,
            output=output,
        )

    assert refused_by_house_rules(monkeypatch, stages, call) == list(expected)
    assert not output.exists()


@pytest.mark.parametrize(("radius_m", "warned"), [(None, False), (20.0, False), (1e5, True)])
def test_a_radius_beyond_the_images_is_warned_of_before_the_search(
    textured: TexturedPair, context: Context, radius_m: float | None, warned: bool
) -> None:
    told: list[str] = []
    noted = replace(context, progress=Progress(lambda fraction, message: told.append(message)))
    spec = replace(COREGISTER, search_radius_m=radius_m)
    with open_pair(textured.reference, textured.input, spec, noted):
        pass
    found = [note for note in told if "beyond the images" in note]
    assert bool(found) == warned
    assert not warned or found[0].startswith("warning: a search radius of 100000 m")


def beside_another_place(share: float, folder: Path) -> tuple[TexturedPair, Path]:
    """Return a pair in which a share of the 64 px squares shows another place, and that place."""
    pair, other = (
        write_textured_pair(made_folder(folder / name), (450, 450), shift_on_map(73.0, -42.0), **of)
        for name, of in (("same", {"noise": 0.5}), ("other", {"input_seed": 5}))
    )
    squares = np.random.default_rng(3).uniform(size=(8, 8)) < share
    is_other = np.kron(squares, np.ones((64, 64), bool))[:450, :450]
    elsewhere = pixels(other.input)[0]
    return (
        rewritten(pair, folder, input=lambda values: np.where(is_other, elsewhere, values)),
        other.input,
    )


def made_folder(folder: Path) -> Path:
    folder.mkdir()
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("share", "is_asked"), [(0.75, True), (0.1, False)])
def test_where_few_check_points_agree_the_exchanged_pair_must_show_the_same(
    share: float, is_asked: bool, tmp_path: Path, context: Context
) -> None:
    pair, _ = beside_another_place(share, tmp_path)
    with open_pair(pair.reference, pair.input, COREGISTER, context) as opened:
        found = run(opened, COREGISTER, context)
    assert found.verdict.accepted and found.evidence is not None
    assert error_px(found.accepted_transform(), pair) < 0.5
    assert found.evidence.needs_second_confirmation == is_asked
    exchanged = found.evidence.exchanged
    assert (exchanged is not None) == is_asked
    if exchanged is not None:
        assert exchanged.rmse_px < 1.5 and exchanged.agreeing >= 4


@pytest.mark.slow
def test_a_transform_that_the_exchanged_pair_does_not_show_is_refused(
    tmp_path: Path, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair, elsewhere = beside_another_place(0.75, tmp_path)
    with (
        open_raster(elsewhere) as other,
        open_pair(pair.reference, pair.input, COREGISTER, context) as opened,
    ):
        exchanged = make_pair(Image(other), opened.images.reference)
        monkeypatch.setattr(ImagePair, "exchanged", lambda _: exchanged)
        found = run(opened, COREGISTER, context)
    assert found.verdict.rule == "exchanged roles"


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_exchanged_roles_show_the_same_across_pixel_sizes(
    ratio: float, tmp_path: Path, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RegistrationEvidence, "needs_second_confirmation", True)
    pair = write_textured_pair(
        tmp_path, (340, 320), shift_on_map(73.0, -42.0), input_pixel_ratio=ratio
    )
    with open_pair(pair.reference, pair.input, COREGISTER, context) as opened:
        found = run(opened, COREGISTER, context)
    assert found.verdict.accepted
    assert found.evidence is not None and found.evidence.exchanged is not None
    assert found.evidence.exchanged.rmse_px < 0.5
