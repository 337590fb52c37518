from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from affine import Affine
from raster_files import utm_grid, write_raster
from textured_pairs import TexturedPair, error_px, write_textured_pair
from turned_pairs import turned_pair

import groundtie
from groundtie.cli import main
from groundtie.declaration import tool_of
from groundtie.errors import NotRegisteredError, ParameterError, SameFileError
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import load_transform
from groundtie.pose.pose import Pose
from groundtie.rasters.grid import apply_affine
from groundtie.studies.pose_searches import SEARCHES
from groundtie.tools.estimate_rotation import RotationResult, estimate_rotation
from groundtie.tools.warp import warp

TRUTH = Pose(-68.0, 1.15, (12.0, -9.0))


def files_of(folder: Path, pose: Pose, **more: Any) -> tuple[Path, Path]:
    """Write a pair without georeferencing."""
    windows = turned_pair(pose, **more)
    names = ("reference.tif", "input.tif")
    paths = [
        write_raster(folder / name, np.clip(window.values, 1, 65_535).astype(np.uint16))
        for name, window in zip(names, windows, strict=True)
    ]
    return paths[0], paths[1]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return files_of(tmp_path_factory.mktemp("plain"), TRUTH)


@pytest.fixture(scope="module")
def estimated(
    plain: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory
) -> tuple[RotationResult, Path]:
    """Return what is found without georeferencing, and the file of its transform."""
    path = tmp_path_factory.mktemp("estimated") / "t.json"
    return estimate_rotation(*plain, transform=path), path


@pytest.fixture(scope="module")
def other_place(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return files_of(tmp_path_factory.mktemp("other"), TRUTH, input_seed=77)


def turned_on_map(
    rotation_deg: float, scale: float, centre: tuple[float, float]
) -> PolynomialModel:
    """Return the misregistration of an input that is turned counter-clockwise on the map."""
    angle = np.radians(rotation_deg)
    linear = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = linear - np.eye(2)
    offset = -moved @ centre
    return PolynomialModel("affine", Frame(Affine.identity()), np.vstack([offset, moved.T]))


class TestWithoutGeoreferencing:
    @pytest.mark.slow
    def test_the_pose_is_found(self, estimated: tuple[RotationResult, Path]) -> None:
        result, path = estimated
        assert result.pose.rotation_deg == pytest.approx(TRUTH.rotation_deg, abs=0.3)
        assert result.pose.scale == pytest.approx(TRUTH.scale, rel=0.01)
        assert (result.right, result.down, result.unit) == (
            pytest.approx(12, abs=0.6),
            pytest.approx(-9, abs=0.6),
            "px",
        )
        verdict = result.summary()["verdict"]
        assert verdict["accepted"] and verdict["height"] > 5 and verdict["rival_ratio"] > 1.6
        assert 6 <= verdict["check_points_agreeing"] <= verdict["check_points"]
        # Pixels without georeferencing have no length in metres.
        assert 0 < verdict["ce90_px"] < 3 and verdict["ce90_m"] is None
        assert not any(" m)" in line for line in result.lines())
        px = np.array([[0.0, 0.0], [159, 0], [0, 149], [159, 149]])
        expected = apply_affine(TRUTH.between((150, 160), (170, 150)), px)
        stored = load_transform(path)
        np.testing.assert_allclose(stored(px), expected, atol=1.5)

    @pytest.mark.slow
    def test_warp_takes_the_transform(
        self,
        plain: tuple[Path, Path],
        estimated: tuple[RotationResult, Path],
        tmp_path: Path,
    ) -> None:
        warp(plain[1], tmp_path / "out.tif", estimated[1], reference=plain[0])
        reference, moved = (
            cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(float)
            for path in (plain[0], tmp_path / "out.tif")
        )
        shown = moved > 0
        assert shown.mean() > 0.5
        # Of opposite contrast, with noise in both.
        assert np.corrcoef(reference[shown], moved[shown])[0, 1] < -0.8

    @pytest.mark.slow
    def test_a_band_can_be_chosen(self, plain: tuple[Path, Path], tmp_path: Path) -> None:
        image = cv2.imread(str(plain[1]), cv2.IMREAD_UNCHANGED)
        noise = np.random.default_rng(0).integers(1, 60_000, image.shape).astype(np.uint16)
        two = write_raster(tmp_path / "two.tif", np.stack([noise, image]))
        scales = {"smallest_scale": 1.0, "largest_scale": 1.3}
        result = estimate_rotation(plain[0], two, input_band=2, **scales)
        assert result.pose.rotation_deg == pytest.approx(TRUTH.rotation_deg, abs=0.3)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    grid = utm_grid(180, 170)
    centre = grid.pixel_to_map([grid.centre_px])[0]
    # What the input claims is turned by 25°, and twice as fine in pixels.
    model = turned_on_map(25.0, 1.1, (centre[0], centre[1]))
    folder = tmp_path_factory.mktemp("turned")
    return write_textured_pair(folder, (180, 170), model, input_pixel_ratio=0.5)


class TestWithGeoreferencing:
    @pytest.mark.slow
    def test_what_is_found_is_the_error_of_the_claim(
        self, pair: TexturedPair, tmp_path: Path
    ) -> None:
        result = estimate_rotation(pair.reference, pair.input, transform=tmp_path / "t.json")
        assert result.unit == "m"
        assert result.pose.rotation_deg == pytest.approx(25.0, abs=0.3)
        assert result.pose.scale == pytest.approx(1.1, rel=0.01)
        assert np.hypot(result.right, result.down) < 10
        # In input pixels, two of which are a reference's.
        assert error_px(load_transform(tmp_path / "t.json"), pair) < 2

    @pytest.mark.slow
    def test_limits(self, pair: TexturedPair) -> None:
        result = estimate_rotation(
            pair.reference,
            pair.input,
            largest_rotation=30,
            smallest_scale=0.9,
            largest_scale=1.2,
            search_radius=150,
        )
        assert result.pose.rotation_deg == pytest.approx(25.0, abs=0.3)
        with pytest.raises(NotRegisteredError, match=r"prefers 2[45]\.\d°"):
            estimate_rotation(pair.reference, pair.input, largest_rotation=5)


class TestRefusal:
    @pytest.mark.slow
    def test_two_places(self, other_place: tuple[Path, Path], tmp_path: Path) -> None:
        outputs = {"transform": tmp_path / "t.json", "picture": tmp_path / "p.png"}
        with pytest.raises(NotRegisteredError) as refusal:
            estimate_rotation(*other_place, **outputs)
        assert refusal.value.exit_code == 3
        assert refusal.value.verdict is not None
        assert refusal.value.verdict.reason in str(refusal.value)
        assert [path.name for path in tmp_path.iterdir()] == ["p.png"]

    @pytest.mark.slow
    def test_on_the_command_line(
        self, other_place: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
    ) -> None:
        near = ["--largest-rotation", "10", "--smallest-scale", "1", "--largest-scale", "1"]
        assert main(["estimate-rotation", *map(str, other_place), *near, "--json"]) == 3
        told = capsys.readouterr()
        assert json.loads(told.out)["verdict"]["accepted"] is False
        assert len(told.err.splitlines()) == 1


class TestSearches:
    @pytest.mark.slow
    @pytest.mark.parametrize("search", [name for name in SEARCHES if name != "rotation-steps"])
    def test_each_finds_a_shift(self, search: str, tmp_path: Path) -> None:
        truth = Pose(shift_px=(5.0, -3.0))
        paths = files_of(tmp_path, truth, reference=(120, 120), input=(120, 120), noise=0.1)
        result = estimate_rotation(
            *paths,
            search,
            largest_rotation=0,
            smallest_scale=1,
            largest_scale=1,
            search_radius=8,
        )
        assert result.search == search
        assert (result.right, result.down) == (
            pytest.approx(5, abs=1),
            pytest.approx(-3, abs=1),
        )

    @pytest.mark.slow
    def test_what_a_search_cannot_find_is_refused(self, plain: tuple[Path, Path]) -> None:
        with pytest.raises(NotRegisteredError, match="prefers") as refusal:
            estimate_rotation(*plain, "phase-correlation", smallest_scale=1, largest_scale=1.3)
        assert refusal.value.verdict is not None
        assert refusal.value.verdict.rule == "other pose"
        assert str(refusal.value).endswith(refusal.value.verdict.advice)

    def test_climbing_needs_a_histogram(self, plain: tuple[Path, Path]) -> None:
        with pytest.raises(ParameterError, match="needs the similarity nmi"):
            estimate_rotation(*plain, "spsa", similarity="ncc")


class TestBadInput:
    def test_scales_the_wrong_way_round(self, plain: tuple[Path, Path]) -> None:
        with pytest.raises(ParameterError, match="smallest scale is larger"):
            estimate_rotation(*plain, smallest_scale=1.5, largest_scale=1.2)

    def test_one_file(self, plain: tuple[Path, Path]) -> None:
        with pytest.raises(SameFileError):
            estimate_rotation(plain[0], plain[0])

    def test_one_clear_line(
        self, plain: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        placed = write_raster(
            tmp_path / "placed.tif", np.ones((50, 50), np.uint16), utm_grid(50, 50)
        )
        assert main(["estimate-rotation", str(plain[0]), str(placed)]) == 2
        told = capsys.readouterr()
        assert told.out == ""
        (line,) = told.err.splitlines()
        assert "has no georeferencing" in line


@pytest.mark.slow
def test_summary_and_lines_say_the_same(
    plain: tuple[Path, Path],
    estimated: tuple[RotationResult, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    picture = tmp_path / "p.png"
    arguments = ["estimate-rotation", *map(str, plain), "--picture", str(picture)]
    assert main([*arguments, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    for output in tool_of(estimate_rotation).outputs:
        assert output.value(told) is not None
    assert told["files"] == {"picture": str(picture)}
    result, _ = estimated
    assert result.pose.rotation_deg == pytest.approx(told["rotation_deg"])
    text = "\n".join(result.lines())
    sense = "anticlockwise" if told["rotation_deg"] > 0 else "clockwise"
    assert f"rotation: {abs(told['rotation_deg']):.2f}° {sense}\n" in text
    assert f"{told['scale']:.4f}" in text
    assert cv2.imread(str(picture)) is not None


@pytest.mark.slow
def test_simulated_radar_and_optical_image(simulated: Any, tmp_path: Path) -> None:
    """The optical image is turned by a right angle, which moves no pixel between others."""
    pair = simulated("similarity")
    truth = load_transform(pair.folder / "truth.json")
    paths = []
    for name, turns in (("reference", 0), ("input", 1)):
        image = cv2.imread(str(pair.folder / f"{name}.tif"), cv2.IMREAD_UNCHANGED)
        bands = image[None] if image.ndim == 2 else np.moveaxis(image, -1, 0)
        turned = np.ascontiguousarray(np.rot90(bands, turns, axes=(1, 2)))
        paths.append(write_raster(tmp_path / f"{name}.tif", turned))
    result = estimate_rotation(*paths, transform=tmp_path / "t.json")
    with groundtie.rasters.reading.open_raster(pair.reference) as source:
        grid = source.grid
    px = np.array([[60.0, 60], [420, 60], [60, 420], [420, 420], [240, 240]])
    cols, rows = truth(grid.pixel_to_map(px)).T
    # Turned counter-clockwise, what was on the right is on top.
    expected = np.column_stack([rows, truth.input_grid.width - 1 - cols])
    off = result.transform(px) - expected
    assert np.sqrt((off**2).sum(axis=1).mean()) < 3
