"""What must be refused is made of images that do not belong together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from benchmark_cases import SIZES, image
from benchmark_outcomes import outcome, outcomes

from benchmarks.accuracy import CRASHED, REFUSED, SILENTLY_WRONG
from benchmarks.cases import REFERENCE_TRANSFORM, RealCase, read_cases, read_image, write_case
from benchmarks.crossings import (
    CROSSING,
    SPECKLE,
    Crossing,
    counts_by_group,
    crossings,
    goals,
    speckle,
    what_was_accepted,
    write_crossing,
    write_speckled,
)

SHIFT = (2.0, 3.0)


def test_crossed_images_claim_the_same_centre_and_pixel_size(
    cases: dict[str, RealCase], tmp_path: Path
) -> None:
    pair = write_crossing(cases["hills"], cases["plain"], tmp_path)
    with rasterio.open(pair.reference) as one, rasterio.open(pair.input) as other:
        assert one.crs == other.crs
        assert one.res == other.res == (1.0, 1.0)
        centres = [s.xy(s.height / 2, s.width / 2, offset="ul") for s in (one, other)]
        np.testing.assert_allclose(centres[0], centres[1])


def test_crossed_images_have_no_truth(cases: dict[str, RealCase], tmp_path: Path) -> None:
    pair = write_crossing(cases["hills"], cases["plain"], tmp_path)
    assert pair.truth is None and pair.lattice is None
    np.testing.assert_array_equal(read_image(pair.input), image("input"))


def test_only_sar_references_are_crossed_and_only_with_other_places(
    cases: dict[str, RealCase],
) -> None:
    assert crossings(list(cases.values())) == [Crossing(cases["hills"], cases["plain"])]


def test_real_crossings_are_enough_and_never_of_the_same_place(real_data: Path) -> None:
    made = crossings(read_cases(real_data))
    assert len(made) >= 200
    assert all(crossing.reference.input != crossing.input.input for crossing in made)
    names = {(crossing.reference.name, crossing.input.name) for crossing in made}
    assert len(names) == len(made)
    # The same meander and the same Sentinel scene stand in two cases each.
    assert ("ss-meander", "ss-yellow-c") not in names
    assert ("ss-yellow-c", "ss-meander") not in names
    assert ("so-cloudy-sentinel", "oo-cloudy-sentinel") not in names
    assert ("so-rosenheim", "ss-meander") in names


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_speckle_has_the_type_and_the_contrast_of_the_image(dtype: type) -> None:
    generator = np.random.default_rng(1)
    original = np.clip(generator.normal(120, 20, (3, 200, 200)), 0, 255).astype(dtype)
    noise = speckle(original, generator)
    assert (noise.shape, noise.dtype) == (original.shape, original.dtype)
    assert noise.mean() == pytest.approx(original.mean(), rel=0.01)
    assert noise.std() == pytest.approx(original.std(), rel=0.03)


def test_speckle_is_the_same_in_all_bands_and_nowhere_like_the_image() -> None:
    original = np.tile(image("reference"), (2, 1, 1))
    noise = speckle(original, np.random.default_rng(2))
    np.testing.assert_array_equal(noise[0], noise[1])
    # Of independent values, 7200 in number, the correlation is normal with 1 / sqrt 7200.
    correlation = np.corrcoef(noise[0].ravel(), original[0].ravel())[0, 1]
    assert abs(correlation) < 4 / np.sqrt(original[0].size)


def test_speckle_is_rayleigh_distributed() -> None:
    # Skewness of the Rayleigh distribution: 2 sqrt(pi) (pi - 3) / (4 - pi)^1.5 = 0.631.
    original = np.random.default_rng(3).normal(0, 1, (1, 300, 300)).astype(np.float32)
    noise = speckle(original, np.random.default_rng(4)).astype(float)
    standard = (noise - noise.mean()) / noise.std()
    assert np.mean(standard**3) == pytest.approx(0.631, abs=0.05)


def test_speckle_stays_within_the_range_of_the_type() -> None:
    bright = np.full((1, 50, 50), 250, np.uint8)
    bright[0, ::2] = 120
    noise = speckle(bright, np.random.default_rng(5))
    assert noise.max() == 255
    assert noise.mean() > 120


@pytest.mark.parametrize("replaced", list(SPECKLE))
def test_one_image_is_replaced_and_the_other_kept(
    cases: dict[str, RealCase], tmp_path: Path, replaced: str
) -> None:
    for name in ("whole", "noisy"):
        (tmp_path / name).mkdir()
    whole = write_case(cases["hills"], SHIFT, tmp_path / "whole")
    noisy = write_speckled(cases["hills"], SHIFT, replaced, tmp_path / "noisy")
    assert noisy.truth is None
    for which in SIZES:
        pixels = [read_image(getattr(pair, which)) for pair in (whole, noisy)]
        assert np.array_equal(*pixels) == (which != replaced)
        with rasterio.open(getattr(whole, which)) as a, rasterio.open(getattr(noisy, which)) as b:
            assert a.transform == b.transform


def test_one_acceptance_fails_the_goal() -> None:
    (goal,) = goals([*outcomes({REFUSED: 300}), outcome(SILENTLY_WRONG)])
    assert (goal.found, goal.reached) == ("1 of 301, 300 refused", False)


def test_too_few_refusals_do_not_reach_the_goal() -> None:
    assert goals(outcomes({REFUSED: 200}))[0].reached is True
    assert goals(outcomes({REFUSED: 199}))[0].reached is None
    assert goals(outcomes({REFUSED: 10, SILENTLY_WRONG: 1}))[0].reached is False


def test_a_crash_is_no_refusal() -> None:
    (goal,) = goals(outcomes({REFUSED: 200, CRASHED: 1}))
    assert goal.reached is False


def test_what_was_accepted_is_named() -> None:
    wrong = outcome(SILENTLY_WRONG, name="a × b", group=CROSSING)
    some = [wrong, outcome(REFUSED, group=CROSSING), outcome(CRASHED, group=CROSSING)]
    assert what_was_accepted(some).rows == [["a × b", "affine", "0.40"]]
    assert counts_by_group(some).rows == [[CROSSING, "3", "1", "1", "1.0"]]


def test_the_reference_keeps_its_place(cases: dict[str, RealCase], tmp_path: Path) -> None:
    pair = write_crossing(cases["plain"], cases["hills"], tmp_path)
    with rasterio.open(pair.reference) as source:
        assert source.transform == REFERENCE_TRANSFORM
