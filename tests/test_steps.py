"""The steps of a registration on arrays, one by one and one after the other."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from raster_files import UTM, utm_grid
from textured_pairs import texture

from groundtie import Raster, steps
from groundtie.errors import NoOverlapError, ParameterError, TooFewPointsError
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import TERRAIN, Frame, shift_model
from groundtie.geometry.terrain_model import TerrainModel
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.pair import ImagePair
from groundtie.registration.evidence import RegistrationEvidence
from groundtie.registration.specification import COREGISTER
from groundtie.similarity.surface import SIMILARITIES

SIZE = 384
MARGIN = 20
# What lies at a pixel of the reference lies so many columns and rows further on in the input.
SHIFT = np.array([4, -3])
NOWHERE: Any = None
OF_TERRAIN = TerrainModel(TERRAIN, Frame.around(9.0 * np.eye(2)), np.zeros((4, 2)), NOWHERE, 0.0)


def pair(seed: int = 0, noise: float = 0.2) -> tuple[Any, Any]:
    """Return a texture and its noisy negative, which lies SHIFT further on, as arrays.

    With little noise, its edges coincide as sharply as those of what is drawn into both.
    """
    scene = texture(SIZE + 2 * MARGIN, SIZE + 2 * MARGIN, seed)
    left, top = MARGIN - SHIFT
    noisy = np.random.default_rng(seed + 9).normal(0, noise, (SIZE, SIZE))
    reference = scene[MARGIN : MARGIN + SIZE, MARGIN : MARGIN + SIZE]
    return reference, -scene[top : top + SIZE, left : left + SIZE] + noisy


def no_points() -> TiePoints:
    none = np.zeros((0, 2))
    return TiePoints(
        reference_xy=none,
        input_px=none,
        score=none[:, 0],
        covariance_px2=np.zeros((0, 2, 2)),
        forward_backward_error_px=none[:, 0],
        is_check=np.zeros(0, bool),
        state=np.zeros(0, "U9"),
    )


class TestSurface:
    @pytest.mark.parametrize("similarity", ["fused", "nmi", "orientation"])
    def test_it_peaks_at_the_shift(self, similarity: str) -> None:
        reference, input = (image[:120, :140] for image in pair())
        surface = steps.similarity_surface(reference, input, 10, similarity)
        assert surface.shape == (21, 21)
        peak = steps.find_peak(surface)
        np.testing.assert_allclose(peak.shift_px, SHIFT, atol=0.3)
        assert peak.height > 6 and not peak.at_border

    def test_what_is_masked_or_not_finite_does_not_count(self) -> None:
        reference, input = (image[:120, :140].copy() for image in pair())
        expected = steps.similarity_surface(reference, input, 10)
        masked = np.ma.MaskedArray(reference, np.zeros(reference.shape, bool))
        np.testing.assert_array_equal(steps.similarity_surface(masked, input, 10), expected)
        hidden = (slice(40, 60), slice(50, 90))
        masked[hidden] = np.ma.masked
        reference[hidden] = np.nan
        found = [steps.similarity_surface(image, input, 10) for image in (masked, reference)]
        np.testing.assert_array_equal(*found)
        assert np.abs(found[0] - expected).max() > 0.1
        np.testing.assert_allclose(steps.find_peak(found[0]).shift_px, SHIFT, atol=0.3)

    @pytest.mark.parametrize("value", [0.0, 7.3])
    @pytest.mark.parametrize("similarity", SIMILARITIES)
    def test_what_is_constant_is_like_nothing(self, value: float, similarity: str) -> None:
        image, constant = pair()[1][:120, :140], np.full((120, 140), value)
        framed = np.pad(constant[18:-18, 18:-18], 18, constant_values=value + 9)
        for windows in ((constant, image), (image, constant), (framed, image)):
            surface = steps.similarity_surface(*windows, 10, similarity)
            assert surface.shape == (21, 21) and not surface.any()

    @pytest.mark.parametrize(
        ("asked", "message"),
        [
            ({"radius_px": -2}, "radius_px must be at least 0 px, not -2"),
            ({"radius_px": 2.5}, "radius_px must be a whole number"),
            ({"radius_px": 10, "similarity": "foo"}, "similarity must be one of fused, "),
        ],
    )
    def test_what_is_no_radius_or_similarity(self, asked: dict[str, Any], message: str) -> None:
        with pytest.raises(ParameterError, match=message):
            steps.similarity_surface(*pair(), **asked)

    @pytest.mark.parametrize(
        ("shapes", "message"),
        [
            (((120, 140), (120, 139)), "windows of the same size"),
            (((36, 140), (36, 140)), "must have 37 pixels a side for a radius of 10"),
            (((2, 120, 140), (2, 120, 140)), r"must have the shape \(h, w\), not \(2, 120, 140\)"),
        ],
    )
    def test_what_are_no_windows(self, shapes: Any, message: str) -> None:
        with pytest.raises(ParameterError, match=message):
            steps.similarity_surface(*(np.ones(shape) for shape in shapes), 10)


class TestPeak:
    def test_a_surface_need_not_be_square(self) -> None:
        """As a user cuts it, or has it from elsewhere, in lists."""
        y, x = np.mgrid[-10:11, -20:21]
        surface = 9 - 0.4 * (x - 3.2) ** 2 - 0.3 * (y - 2.1) ** 2
        for given in (surface, surface.tolist()):
            assert steps.find_peak(given).shift_px == pytest.approx((3.2, 2.1))

    @pytest.mark.parametrize("shape", [(20, 20), (21, 20), (5,), (3, 21, 21), (0, 0), ()])
    def test_a_surface_without_a_middle(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(ParameterError, match="must have odd numbers of rows and columns, not"):
            steps.find_peak(np.zeros(shape))

    @pytest.mark.parametrize("value", [np.nan, np.inf, 1j, "a"])
    def test_what_is_no_finite_number(self, value: Any) -> None:
        surface = np.zeros((21, 21)).astype(np.result_type(type(value)))
        surface[4, 5] = value
        with pytest.raises(ParameterError, match="must hold finite numbers: 0 where nothing is"):
            steps.find_peak(surface)


class TestFit:
    def made(self, kind: str, outliers: int, unit: float = 1.0) -> tuple[Any, Any, Any]:
        rng = np.random.default_rng(1)
        xy = rng.uniform(0, 300, (60, 2))
        moved = xy + SHIFT + (0.002 * xy[:, ::-1] if kind != "translation" else 0)
        found = moved + rng.normal(0, 0.1, (60, 2))
        found[:outliers] += rng.uniform(-8, 8, (outliers, 2))
        return unit * xy, unit * moved, unit * found

    @pytest.mark.parametrize("kind", ["translation", "affine", "polynomial2", "tps"])
    @pytest.mark.parametrize("unit", [1.0, 10.0])
    def test_outliers_are_left_out(self, kind: str, unit: float) -> None:
        xy, truth, found = self.made(kind, 20, unit)
        fit = steps.fit_model(kind, xy, found, pixel_size=unit)
        far = np.hypot(*(found - truth).T) > 2.0 * unit
        assert not fit.inliers[far].any()
        assert fit.inliers[20:].mean() > 0.9
        assert fit.sigma < 0.5 * unit
        errors = np.hypot(*(fit.model(xy[20:]) - truth[20:]).T)
        assert np.median(errors) < 0.15 * unit
        np.testing.assert_allclose(fit.model.inverse(fit.model(xy)), xy, atol=1e-4 * unit)

    @pytest.mark.parametrize("kind", ["rigid", "similarity", "affine", "polynomial2", "tps"])
    @pytest.mark.parametrize("turn", [15, 90, 180])
    def test_any_rotation(self, kind: str, turn: int) -> None:
        """Two fifths are outliers, as far off as any place of the image."""
        rng = np.random.default_rng(turn)
        xy = rng.uniform(0, 300, (100, 2))
        cos, sin = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
        truth = xy @ np.array([[cos, sin], [-sin, cos]]) + SHIFT
        found = truth + rng.normal(0, 0.1, xy.shape)
        found[:40] = rng.permutation(found[:40])
        fit = steps.fit_model(kind, xy, found, radius_px=300)
        assert fit.inliers[40:].all() and fit.inliers.sum() < 64
        np.testing.assert_allclose(fit.model(xy), truth, atol=0.5)
        np.testing.assert_allclose(fit.model.inverse(truth), xy, atol=0.5)

    @pytest.mark.parametrize("scale", [0.3, 1.25, 4.0])
    def test_any_scale(self, scale: float) -> None:
        xy = self.made("affine", 0)[0]
        fit = steps.fit_model("similarity", xy, scale * xy)
        assert fit.inliers.all()
        np.testing.assert_allclose(fit.model(xy), scale * xy, atol=1e-6)

    @pytest.mark.parametrize("noise", [1e-3, 0.05, 1.0, 2.4])
    @pytest.mark.parametrize("unit", [1.0, 10.0])
    def test_sigma_is_that_of_the_residuals(self, noise: float, unit: float) -> None:
        rng = np.random.default_rng(2)
        xy = rng.uniform(0, 1000, (400, 2))
        found = xy + SHIFT + rng.normal(0, noise, xy.shape)
        fit = steps.fit_model("translation", unit * xy, unit * found, pixel_size=unit)
        # Of 800 numbers it is known to 1 / √1600, 2.5 %.
        assert fit.sigma == pytest.approx(noise * unit, rel=0.08)

    def test_too_few_points(self) -> None:
        with pytest.raises(TooFewPointsError, match="at least 3 points; there are 2"):
            steps.fit_model("translation", np.zeros((2, 2)), np.zeros((2, 2)))

    @pytest.mark.parametrize("kind", ["rigid", "similarity", "affine", "polynomial2", "tps"])
    def test_points_at_one_place(self, kind: str) -> None:
        xy = np.full((12, 2), 50.0)
        with pytest.raises(TooFewPointsError, match="do not all lie at one place"):
            steps.fit_model(kind, xy, xy + SHIFT)

    @pytest.mark.parametrize("kind", ["affine", "tps"])
    def test_points_on_a_line(self, kind: str) -> None:
        xy = np.linspace(0, 110, 12)[:, None] * [1, 0.3] + [7, 11]
        with pytest.raises(TooFewPointsError, match="do not all lie on a line"):
            steps.fit_model(kind, xy, xy + SHIFT)
        steps.fit_model("similarity", xy, xy + SHIFT)

    def test_points_on_two_rows(self) -> None:
        """Which are a curve of degree 2, of which nothing tells how the model bends across."""
        xy = np.stack(np.meshgrid(np.linspace(0, 300, 8), [0.0, 200.0]), -1).reshape(-1, 2)
        steps.fit_model("affine", xy, xy + SHIFT)
        with pytest.raises(TooFewPointsError, match="do not all lie on a curve of degree 2"):
            steps.fit_model("polynomial2", xy, xy + SHIFT)

    def test_a_kind_that_is_none(self) -> None:
        with pytest.raises(ParameterError, match=r"one of translation, .*, not 'rubb'"):
            steps.fit_model("rubb", np.zeros((9, 2)), np.zeros((9, 2)))

    @pytest.mark.parametrize(
        ("asked", "message"),
        [
            ({"pixel_size": 0}, "pixel_size must be above 0, not 0"),
            ({"pixel_size": -1}, "pixel_size must be above 0, not -1"),
            ({"pixel_size": "a"}, "pixel_size must be a number, not 'a'"),
            ({"tolerance_px": 0}, "tolerance_px must be above 0, not 0"),
            ({"tolerance_px": np.nan}, "tolerance_px must be a finite number, not nan"),
            ({"radius_px": -0.5}, "radius_px must be at least 0 px, not -0.5"),
            ({"radius_px": np.inf}, "radius_px must be a finite number, not inf"),
            ({"seed": -1}, "seed must be at least 0, not -1"),
            ({"seed": 1.5}, "seed must be a whole number, not 1.5"),
        ],
    )
    def test_what_is_out_of_range(self, asked: dict[str, Any], message: str) -> None:
        xy, _, found = self.made("translation", 0)
        with pytest.raises(ParameterError, match=message):
            steps.fit_model("translation", xy, found, **asked)

    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_a_position_that_is_none(self, value: float) -> None:
        xy, _, found = self.made("affine", 0)
        found[7] = value
        with pytest.raises(ParameterError, match=r"positions must be finite numbers; 1 of 60 are"):
            steps.fit_model("affine", xy, found)

    def test_positions_that_are_no_numbers(self) -> None:
        with pytest.raises(ParameterError, match="positions must be numbers: could not convert"):
            steps.fit_model("affine", "abc", [["a"]])

    def test_positions_that_are_no_pairs(self) -> None:
        xy, _, found = self.made("affine", 0)
        with pytest.raises(ParameterError, match=r"the shape \(\.\.\., 2\), not \(2, 60\)"):
            steps.fit_model("affine", xy.T, found.T)
        with pytest.raises(ParameterError, match=r"60 positions .*, but 59 in the input"):
            steps.fit_model("affine", xy, found[1:])


class TestWhatCannotBeMatchedOrJudged:
    """One line, before anything is opened."""

    @pytest.mark.parametrize(
        ("asked", "message"),
        [
            ({"radius_px": 0}, "radius_px must be at least 1 px, not 0"),
            ({"radius_px": 2.5}, "radius_px must be a whole number, not 2.5"),
            ({"radius_px": "a"}, "radius_px must be a number, not 'a'"),
            ({"model": "x"}, "model must be a Model, not a str"),
            ({"spec": "x"}, "spec must be a Specification, not a str"),
            ({"context": "x"}, "context must be a Context, not a str"),
        ],
    )
    def test_match_chips(self, asked: dict[str, Any], message: str) -> None:
        with pytest.raises(ParameterError, match=message):
            steps.match_chips("reference.tif", "input.tif", **asked)

    @pytest.mark.parametrize(
        ("asked", "message"),
        [
            ({"model": None}, "model must be a Model, not a NoneType"),
            ({"model": steps.Fit(shift_model(0, 0), np.ones(3, bool), 1.0)}, "not a Fit"),
            ({"model": OF_TERRAIN}, "points alone do not determine a model of terrain"),
            ({"points": [[0, 0]]}, "points must be a TiePoints, not a list"),
            ({"spec": "x"}, "spec must be a Specification, not a str"),
        ],
    )
    def test_judge(self, asked: dict[str, Any], message: str) -> None:
        given = {"model": shift_model(0, 0), "points": no_points()} | asked
        with pytest.raises(ParameterError, match=message):
            steps.judge("reference.tif", "input.tif", **given)

    def test_a_model_of_no_points_is_refused(self) -> None:
        verdict = steps.judge(*pair(), shift_model(0, 0), no_points())
        assert not verdict.accepted
        assert verdict.rule == "too few points"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"matcher": "foo"}, "matcher must be one of chips, keypoints, guided-chips, not 'foo'"),
        ({"similarity": "foo"}, "similarity must be one of fused, nmi, .*, not 'foo'"),
        ({"refinement": None}, "refinement must be one of fused, nmi, .*, not None"),
        ({"model": "foo"}, "model must be one of auto, translation, .*, not 'foo'"),
        ({"candidates": ("affine", "foo")}, "candidates must be one of translation, .*, not"),
        ({"radar": "foo"}, "radar must be one of auto, reference, input, both, neither, not"),
        ({"max_error_px": float("nan")}, "max_error_px must be a finite number from 0 on, not nan"),
        ({"search_radius_m": -5}, "search_radius_m must be a finite number from 0 on, not -5"),
    ],
)
def test_what_cannot_be_specified(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        replace(COREGISTER, **asked)


class TestFromImagesToVerdict:
    """Match, fit and judge, without files."""

    @pytest.mark.slow
    def test_arrays_in_pixel_coordinates(self) -> None:
        reference, input = pair(noise=0.8)
        points = steps.match_chips(reference, input)
        assert not points.is_check.any()
        fit = steps.fit_model("affine", points.reference_xy, points.input_px)
        corners = np.array([[0, 0], [SIZE - 1, 0], [0, SIZE - 1], [SIZE - 1, SIZE - 1]])
        np.testing.assert_allclose(fit.model(corners), corners + SHIFT, atol=0.5)
        inliers = points.reject(~fit.inliers, "disagrees with the model")
        verdict = steps.judge(reference, input, fit.model, inliers)
        assert verdict.accepted
        assert verdict.fit_points_used == fit.inliers.sum()
        assert verdict.check_rmse_px < 0.5

    @pytest.mark.slow
    def test_few_check_points_need_those_of_the_exchanged_pair(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def nothing(_: ImagePair) -> ImagePair:
            raise NoOverlapError("not there")

        reference, input = pair(noise=0.8)
        points = steps.match_chips(reference, input)
        right = fit_model("translation", points.reference_xy, points.reference_xy + SHIFT)
        monkeypatch.setattr(RegistrationEvidence, "needs_second_confirmation", True)
        assert steps.judge(reference, input, right, points).accepted
        monkeypatch.setattr(ImagePair, "exchanged", nothing)
        assert steps.judge(reference, input, right, points).rule == "exchanged roles"

    @pytest.mark.slow
    def test_a_wrong_model_is_refused(self) -> None:
        reference, input = pair()
        points = steps.match_chips(reference, input)
        wrong = fit_model("translation", points.reference_xy, points.reference_xy + [30, 25])
        verdict = steps.judge(reference, input, wrong, points)
        assert not verdict.accepted
        assert verdict.rule == "chance agreement"

    @pytest.mark.slow
    def test_different_places_are_refused(self) -> None:
        reference, input = pair()[0], pair(seed=5)[1]
        points = steps.match_chips(reference, input)
        fit = steps.fit_model("affine", points.reference_xy, points.input_px)
        verdict = steps.judge(reference, input, fit.model, points.reject(~fit.inliers, "far"))
        assert not verdict.accepted
        assert verdict.rule == "too few points"

    @pytest.mark.slow
    def test_rasters_on_the_map(self) -> None:
        grid = utm_grid(SIZE, SIZE)
        reference, input = (Raster(image, grid.transform, UTM) for image in pair(noise=0.8))
        points = steps.match_chips(reference, input)
        nominal = Transform.nominal(UTM, grid)
        nominal_xy = nominal.nominal_xy(points.input_px)
        fit = steps.fit_model("affine", points.reference_xy, nominal_xy, pixel_size=10.0)
        centre = grid.pixel_to_map([[SIZE / 2, SIZE / 2]])
        np.testing.assert_allclose(fit.model(centre) - centre, [[40, 30]], atol=2)
        again = steps.match_chips(reference, input, fit.model, radius_px=4)
        assert again.used.sum() >= points.used.sum() * 0.9
        inliers = points.reject(~fit.inliers, "disagrees with the model")
        assert steps.judge(reference, input, fit.model, inliers).accepted
