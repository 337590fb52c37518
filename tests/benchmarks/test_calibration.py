"""Said and true errors are compared by what they mean: shares of places, by class."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import rasterio
from scipy.stats import binomtest

import groundtie
from benchmarks import calibration
from benchmarks.accuracy import CRASHED, REFUSED, Truth, lattice
from benchmarks.attempt import Pair, on_pixels
from benchmarks.calibration import ACCEPTED, CalibrationRun, RealPairCase, SimulatedCase
from benchmarks.optical_pairs import OpticalPair
from benchmarks.suites import Settings
from groundtie.errors import NotRegisteredError
from groundtie.geometry.accuracy import Accuracy
from groundtie.geometry.transform import load_transform
from groundtie.registration.verdict import Verdict

SIZE = 300


def accepted(*within: float, group: str = "rural", rms_px: float = 0.5) -> CalibrationRun:
    return CalibrationRun("a", group, ACCEPTED, "", rms_px, 0.0, 0.3, 1.0, 1.2, within)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    yield OpticalPair(SIZE, "rural", 3).pair(tmp_path_factory.mktemp("cache"))


class Found:
    """A registration whose transform errs by some pixels to the right."""

    def __init__(self, pair: Pair, off_px: float, ce90_px: float) -> None:
        truth = load_transform(pair.reference.with_name("truth.json"))
        self.transform = lambda xy: truth(xy) + [off_px, 0]
        self.verdict = Verdict(
            True,
            "fine",
            accuracy=Accuracy(ce90_px / 2, ce90_px, 1.2 * ce90_px, (ce90_px, ce90_px)),
        )


def test_places_within_the_radii_are_counted(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    linear = np.linalg.inv(pair.lattice.linear) if pair.lattice else np.eye(2)
    length = float(np.hypot(*(linear @ [1.0, 0])))
    monkeypatch.setattr(groundtie, "coregister", lambda *_, **__: Found(pair, 1.0, 1.0))
    found = calibration.compare("a", "rural", "coregister", pair, 20.0, 1)
    assert found.rms_px == pytest.approx(length, abs=1e-6)
    assert found.within == (0.0, float(length <= 1.0), 1.0)
    assert "holds" in found.line()


def test_refusals_and_crashes_are_told_apart(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise NotRegisteredError("/a/b was not registered", Verdict(False, "too few"))

    def crash(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(groundtie, "coregister", refuse)
    found = calibration.compare("a", "rural", "coregister", pair, 20.0, 1)
    assert (found.verdict, found.reason) == (REFUSED, "too few")
    assert found.record()["rms_px"] is None
    monkeypatch.setattr(groundtie, "coregister", crash)
    assert calibration.compare("a", "b", "coregister", pair, 20.0, 1).verdict == CRASHED


def test_a_truth_that_errs_widens_the_radii() -> None:
    """Two circular normal errors of 1 px (RMS): 90 % within √2 · √ln 10."""
    one = math.sqrt(math.log(10))
    assert calibration.with_truth_px(one, 0.9, 1.0) == pytest.approx(math.sqrt(2) * one)
    assert calibration.with_truth_px(0.7, 0.9, 0.0) == 0.7


def test_errors_are_measured_in_reference_pixels() -> None:
    places = lattice((100, 100))
    truth = Truth(places, 2 * places, 2 * np.eye(2))
    np.testing.assert_allclose(np.hypot(*truth.off_px(lambda px: 2 * px + [3.0, 4.0]).T), 2.5)


@pytest.mark.parametrize(("held", "count"), [(0, 5), (18, 20), (20, 20), (50, 100)])
def test_the_interval_is_wilsons(held: int, count: int) -> None:
    expected = binomtest(held, count).proportion_ci(0.95, "wilson")
    low, high = calibration.wilson(held / count, count)
    assert (low, high) == pytest.approx((expected.low, expected.high), abs=1e-3)
    assert calibration.wilson(math.nan, 0) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("share", "count", "reached"), [(0.9, 20, True), (0.8, 20, False), (0.97, 20, False)]
)
def test_a_class_is_calibrated_if_its_share_is_what_is_said(
    share: float, count: int, reached: bool
) -> None:
    runs = [accepted(0.5, share, 0.95)] * count
    assert calibration.goal("rural", runs).reached is reached
    assert calibration.goal("rural", runs[:19]).reached is None
    assert calibration.goal("rural", []).reached is None


def test_the_table_has_a_row_for_each_class_and_one_for_all_that_are_simulated() -> None:
    refused = CalibrationRun("a", "city", REFUSED, "too few")
    groups = {
        "rural": [accepted(0.4, 0.9, 1.0), accepted(0.6, 1.0, 1.0, rms_px=2.0)],
        "city": [refused],
        "real sar-sar": [accepted(0.0, 0.0, 0.0, group="real sar-sar")],
    }
    rows = {row[0]: row for row in calibration.coverage_table(groups).rows}
    assert list(rows) == ["rural", "city", "real sar-sar", "all simulated"]
    assert rows["rural"][1:3] == ["2", "2"]
    assert (rows["rural"][5], rows["rural"][6], rows["rural"][9]) == ("50%", "95%", "50%")
    assert rows["city"][2:4] == ["0", "–"]
    assert rows["all simulated"][1:3] == ["3", "2"]


def test_every_class_and_size_is_drawn_for_the_seeds(tmp_path: Path, real_data: Path) -> None:
    settings = Settings(False, 5, 1, real_data, tmp_path, first_seed=200)
    found = [case for case in calibration.cases(settings) if isinstance(case, SimulatedCase)]
    small = [case for case in found if "large" not in case.group]
    assert len({case.group for case in small}) == 10
    assert len(small) == 5 * 10
    # Seed 200 alone is a multiple of five.
    assert len(found) - len(small) == 8
    assert len({case.made.name for case in found}) == len(found)
    real = [case for case in calibration.cases(settings) if isinstance(case, RealPairCase)]
    assert all(case.number == 200 for case in real)


def test_optical_pairs_lie_where_their_truth_has_them(pair: Pair) -> None:
    """Grey values of both dates are most alike where the truth says, and less 4 px beside it."""
    assert pair.truth is not None
    with rasterio.open(pair.reference) as first, rasterio.open(pair.input) as second:
        reference, later = (image.read(1).astype(np.float32) for image in (first, second))
    places = np.stack(np.meshgrid(*[np.arange(20, SIZE - 20)] * 2), -1).reshape(-1, 2)
    px = on_pixels(load_transform(pair.reference.with_name("truth.json")), pair.reference)(places)
    seen = reference[places[:, 1], places[:, 0]]

    def likeness(off_px: float) -> float:
        at = (px + [off_px, 0]).astype(np.float32).reshape(SIZE - 40, SIZE - 40, 2)
        found = cv2.remap(later, at, None, cv2.INTER_LINEAR)
        return float(abs(np.corrcoef(seen, found.ravel())[0, 1]))

    assert likeness(0.0) > max(likeness(-4.0), likeness(4.0)) + 0.02


def test_classes_may_be_chosen(tmp_path: Path, real_data: Path) -> None:
    names = ("rural, large", "real sar-sar")
    settings = Settings(False, 5, 1, real_data, tmp_path, first_seed=200, classes=names)
    assert {case.group for case in calibration.cases(settings)} == set(names)
    with pytest.raises(ValueError, match="no class 'rurals'"):
        calibration.cases(dataclasses.replace(settings, classes=("rurals",)))
