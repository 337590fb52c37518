from __future__ import annotations

import numpy as np
import pytest
from speckled_pairs import radar_image, whole

from groundtie.errors import ParameterError
from groundtie.features.keypoints import Keypoints
from groundtie.studies.evaluation import Consistency, Variant, evaluate
from groundtie.studies.sift_variants import SiftVariantDescriptor, sift_detector


def points(px: np.ndarray) -> Keypoints:
    count = len(px)
    return Keypoints(np.asarray(px, float), np.full(count, 2.0), np.zeros(count), np.ones(count))


def test_names_of_variants() -> None:
    assert Variant.parse("sift") == Variant("sift", sift_detector("sift"), SiftVariantDescriptor())
    assert Variant.parse("oriented+sift-oct+roewa", 0.05) == Variant(
        "oriented+sift-oct+roewa",
        sift_detector("sift-oct", 0.05),
        SiftVariantDescriptor("roewa", upright=False),
    )


@pytest.mark.parametrize(
    "name",
    ["", "roewa", "sift+sift-oct", "sift+roewa+recursive", "sift+sobel", "sift+oriented+oriented"],
)
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(ParameterError, match="is no variant"):
        Variant.parse(name)


def test_the_same_image_repeats_and_matches_fully() -> None:
    window = whole(radar_image(150, 150))
    found = evaluate(Variant.parse("sift-oct"), window, window, 0.8, "exact")
    assert found.detections[0] == found.detections[1] > 50
    assert found.repeated[0] == 1
    assert found.matched.matches > 0.9 * found.detections[0]
    assert found.filtered.matches == found.matched.matches
    assert found.matched.by_class[0] == found.matched.matches
    assert max(found.matched.std_px) < 1e-6


def test_two_places_repeat_by_chance_only_and_filtering_leaves_few_matches() -> None:
    one, other = (whole(radar_image(250, 250, seed)) for seed in (0, 5))
    found = evaluate(Variant.parse("sift-oct"), one, other, 1.0, "exact")
    # The probability that one of n features lies within 2.4 px, about where the first class ends.
    chance = 1 - np.exp(-max(found.detections) * np.pi * 2.4**2 / 250**2)
    assert found.repeated[0] < chance
    assert min(found.matched.std_px) > 30


def test_consistency_is_the_standard_deviation_from_an_affine_fit() -> None:
    rng = np.random.default_rng(0)
    px = rng.uniform(0, 500, (4000, 2))
    partner = px @ [[1.01, 0.02], [-0.02, 0.99]] + [5, 6] + rng.normal(0, [0.5, 2.0], px.shape)
    found = Consistency.of(points(px), points(partner))
    np.testing.assert_allclose(found.std_px, [0.5, 2.0], rtol=0.05)
    assert found.by_class.sum() == found.matches == 4000


def test_too_few_matches_have_no_consistency() -> None:
    found = Consistency.of(points(np.zeros((2, 2))), points(np.zeros((2, 2))))
    assert np.isnan(found.std_px).all()
    assert found.summary()["std_px"] is None
