from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.svm import SVC

from groundtie.errors import ParameterError, TooFewPointsError
from groundtie.features import classifier_training
from groundtie.features.classifier import KERNELS, read_classifier
from groundtie.features.classifier_training import Training, left_out_accuracy, train_classifier
from groundtie.rasters.patch import Patch

# Mean and variance of ground and of clouds, as an image of 8 bits may have them.
SIZE_PX = 500.0


def labelled(count: int = 150, seed: int = 0) -> Training:
    random = np.random.default_rng(seed)
    ground = np.column_stack([random.normal(90, 15, count), random.normal(300, 80, count)])
    clouds = np.column_stack([random.normal(140, 20, count), random.normal(450, 150, count)])
    kept = np.repeat([True, False], count)
    px = random.uniform(0, SIZE_PX, (2 * count, 2))
    return Training(np.vstack([ground, clouds]), kept, px)


@pytest.mark.parametrize("kernel", KERNELS)
def test_decisions_are_those_of_scikit_learn(kernel: str, tmp_path: Path) -> None:
    points = labelled()
    found = train_classifier(points, "mean-variance", kernel, 10.0, 0)
    found.write(tmp_path / "classifier.json")
    stored = read_classifier(tmp_path / "classifier.json")
    name = {"polynomial": "poly", "quadratic": "poly"}.get(kernel, kernel)
    machine = SVC(
        kernel=name,
        degree={"polynomial": 3, "quadratic": 2}.get(kernel, 1),
        gamma=0.5,
        coef0=1.0,
        class_weight="balanced",
    )
    scaled = (points.statistics - points.statistics.mean(0)) / points.statistics.std(0)
    machine.fit(scaled, points.kept)
    # All around the training's points, too: there, the nearest that it has seen decides.
    others = np.random.default_rng(1).uniform([20, 0], [220, 1000], (400, 2))
    low, high = points.statistics.min(0), points.statistics.max(0)
    seen = np.clip(others, low, high)
    assert (seen != others).any()
    expected = machine.decision_function(
        (seen - points.statistics.mean(0)) / points.statistics.std(0)
    )
    np.testing.assert_allclose(stored.decide(others), expected, atol=1e-6 * np.abs(expected).max())
    assert stored.pixel_size_m == 10.0


@pytest.mark.parametrize("kernel", KERNELS)
def test_points_that_were_not_seen_are_told_apart(kernel: str) -> None:
    found = train_classifier(labelled(), "mean-variance", kernel, 10.0, 0)
    others = labelled(seed=5)
    assert np.mean((found.decide(others.statistics) > 0) == others.kept) > 0.85
    assert left_out_accuracy(labelled(), "mean-variance", kernel, 0) > 0.85


def test_labels_without_meaning_are_told_by_chance() -> None:
    points = labelled()
    random = np.random.default_rng(2)
    shuffled = Training(points.statistics, random.permutation(points.kept), points.px)
    assert left_out_accuracy(shuffled, "mean-variance", "polynomial", 0) == pytest.approx(
        0.5, abs=0.12
    )


def test_rare_classes_count_as_much_as_common_ones_if_they_are_to() -> None:
    points = labelled()
    few = points.take(points.kept | (np.arange(300) >= 280))
    others = labelled(seed=5)
    met = others.take(others.kept | (np.arange(300) >= 280))

    def wrong(balanced: bool, by: Training) -> tuple[float, float]:
        found = train_classifier(few, "mean-variance", "linear", 1.0, 0, balanced)
        told = found.decide(by.statistics) > 0
        return float((told[~by.kept]).mean()), float((told != by.kept).mean())

    assert wrong(True, others)[0] < 0.2
    assert wrong(True, others)[0] < wrong(False, others)[0]
    # As common as they were in the training, fewer are told wrongly without weights.
    assert wrong(False, met)[1] < wrong(True, met)[1]


def test_points_that_are_left_out_of_the_training_still_tell_how_common_a_class_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points = labelled(400)
    few = points.take(points.kept | (np.arange(800) >= 740))
    others = labelled(seed=5).statistics
    whole = train_classifier(few, "mean-variance", "linear", 1.0, 0).decide(others) > 0
    monkeypatch.setattr(classifier_training, "_MOST_POINTS", 60)
    part = train_classifier(few, "mean-variance", "linear", 1.0, 0).decide(others) > 0
    alike = train_classifier(few, "mean-variance", "linear", 1.0, 0, True).decide(others) > 0
    assert np.mean(part != whole) < 0.5 * np.mean(alike != whole)


def test_a_class_with_too_few_points_is_refused() -> None:
    points = labelled()
    with pytest.raises(TooFewPointsError, match="only 9 labelled points are to be left out"):
        train_classifier(points.take(np.arange(159)), "mean-variance", "rbf", 1.0, 0)


def test_clouds_in_a_window_are_left_out() -> None:
    random = np.random.default_rng(0)
    values = random.normal(90, 15, (120, 200)).astype(np.float32)
    values[:, 100:] = random.normal(160, 25, (120, 100))
    found = train_classifier(labelled(), "mean-variance", "polynomial", 1.0, 0)
    window = Patch(values, np.ones(values.shape, bool))
    px = np.array([[40.0, 60], [30, 90], [150, 60], [170, 30]])
    assert found.keep(window, px).tolist() == [True, True, False, False]


def colours(count: int = 150, seed: int = 0) -> Training:
    """Return ground and clouds of like grey values; the ground is red."""
    random = np.random.default_rng(seed)
    red = np.repeat([0.45, 0.34], count) + random.normal(0, 0.02, 2 * count)
    grey = np.column_stack([random.normal(120, 20, 2 * count), random.normal(400, 90, 2 * count)])
    shares = np.column_stack([red, 0.6 * (1 - red), 0.4 * (1 - red)])
    kept = np.repeat([True, False], count)
    return Training(np.hstack([grey, shares]), kept, random.uniform(0, SIZE_PX, (300, 2)), 3)


def test_what_differs_in_colour_alone_is_told_by_its_bands(tmp_path: Path) -> None:
    train_classifier(colours(), "band-ratios", "polynomial", 10.0, 0).write(tmp_path / "c.json")
    stored = read_classifier(tmp_path / "c.json")
    assert stored.bands == 3
    window = Patch(np.full((60, 200), 120, np.float32), np.ones((60, 200), bool))
    bands = np.full((3, 60, 200), 120, np.float32)
    bands[:, :, :100] *= np.array([1.35, 0.99, 0.66], np.float32)[:, None, None]
    px = np.array([[40.0, 30.0], [160.0, 30.0]])
    assert stored.keep(window, px, bands).tolist() == [True, False]
    assert left_out_accuracy(colours(), "band-ratios", "polynomial", 0) > 0.95


@pytest.mark.parametrize(
    "change",
    [
        {"format": "another"},
        {"version": 2},
        {"kernel": "sigmoid"},
        {"statistics": "colour"},
        {"weights": [1.0]},
        {"vectors": []},
        {"mean": [0.0, 0.0, 0.0]},
        {"intercept": "much"},
        {"gamma": float("nan")},
        {"bands": 3},
        {"statistics": "band-ratios"},
    ],
)
def test_a_file_that_is_none_is_refused(change: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "classifier.json"
    train_classifier(labelled(), "mean-variance", "rbf", 1.0, 0).write(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ParameterError, match="is no feature classifier"):
        read_classifier(path)


def test_no_json_is_refused(tmp_path: Path) -> None:
    (tmp_path / "c.json").write_text("once upon a time")
    with pytest.raises(ParameterError, match="is no feature classifier"):
        read_classifier(tmp_path / "c.json")
    (tmp_path / "e.json").write_text('{"format": "of another program"}')
    with pytest.raises(ParameterError, match="is missing"):
        read_classifier(tmp_path / "e.json")
    (tmp_path / "l.json").write_text("[1, 2]")
    with pytest.raises(ParameterError, match="is no feature classifier"):
        read_classifier(tmp_path / "l.json")
