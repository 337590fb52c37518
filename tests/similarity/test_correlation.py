from __future__ import annotations

import cv2
import numpy as np
import pytest

from groundtie.rasters.patch import Patch
from groundtie.similarity.correlation import (
    box_sums,
    correlate,
    correlate_fields,
    correlate_grey,
    overlap_share,
)

RADIUS = 4
SHAPE = (17, 22)
SIZE = (SHAPE[0] + 2 * RADIUS, SHAPE[1] + 2 * RADIUS)
SPAN = 2 * RADIUS + 1


def patches(masked: bool, seed: int = 0, level: float = 0.0) -> tuple[Patch, Patch]:
    rng = np.random.default_rng(seed)

    def patch(shape: tuple[int, int], share: float) -> Patch:
        values = (level + rng.normal(0, 20, shape)).astype(np.float32)
        valid = rng.random(shape) < share
        return Patch(np.where(valid, values, np.float32(0)), valid)

    return patch(SHAPE, 0.7 if masked else 2), patch(SIZE, 0.8 if masked else 2)


def fields(masked: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    (t, s), (t2, s2) = patches(masked), patches(masked, 1)
    template = np.where(t.valid, t.values + 1j * t2.values, 0).astype(np.complex64)
    search = np.where(s.valid, s.values + 1j * s2.values, 0).astype(np.complex64)
    return template, search, t.valid, s.valid


def windows_of(array: np.ndarray) -> np.ndarray:
    return np.lib.stride_tricks.sliding_window_view(array, SHAPE)


@pytest.mark.parametrize("complex_valued", [False, True])
def test_plain_correlation(complex_valued: bool) -> None:
    template, search, _, _ = fields(False)
    if not complex_valued:
        template, search = template.real, search.real
    expected = (windows_of(search) * template.conj()).sum(axis=(2, 3)).real
    found = correlate(template, search)
    assert found.shape == (SPAN, SPAN)
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("masked", [False, True])
def test_fields_against_their_definition(masked: bool) -> None:
    template, search, template_valid, search_valid = fields(masked)
    expected = np.empty((SPAN, SPAN))
    for dy, dx in np.ndindex(SPAN, SPAN):
        both = template_valid & windows_of(search_valid)[dy, dx]
        t, s = template[both].astype(complex), windows_of(search)[dy, dx][both].astype(complex)
        expected[dy, dx] = np.vdot(t, s).real / (np.linalg.norm(t) * np.linalg.norm(s))
    found = correlate_fields(template[None], search[None], template_valid, search_valid)[0]
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert np.abs(found).max() <= 1


def test_a_field_agrees_with_itself_alone() -> None:
    template, search, template_valid, search_valid = fields(False)
    search[RADIUS + 2 : RADIUS + 2 + SHAPE[0], RADIUS - 1 : RADIUS - 1 + SHAPE[1]] = template
    found = correlate_fields(template[None], search[None], template_valid, search_valid)[0]
    assert np.unravel_index(found.argmax(), found.shape) == (RADIUS + 2, RADIUS - 1)
    assert found.max() == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("level", [0.0, 5000.0])
def test_grey_values_against_opencv(level: float) -> None:
    template, search = patches(False, level=level)
    exact = [patch.values.astype(np.float64) - level for patch in (search, template)]
    expected = cv2.matchTemplate(*(e.astype(np.float32) for e in exact), cv2.TM_CCOEFF_NORMED)
    np.testing.assert_allclose(correlate_grey(template, search), expected, atol=2e-4)


def coefficients(template: Patch, search: Patch) -> np.ndarray:
    """Padfield 2012: the correlation coefficient of the pixels that are valid in both."""
    expected = np.empty((SPAN, SPAN))
    for dy, dx in np.ndindex(SPAN, SPAN):
        both = template.valid & windows_of(search.valid)[dy, dx]
        pair = template.values[both], windows_of(search.values)[dy, dx][both]
        expected[dy, dx] = np.corrcoef(*(p.astype(float) for p in pair))[0, 1]
    return expected


@pytest.mark.parametrize("level", [0.0, 300.0])
def test_masked_grey_values_against_their_definition(level: float) -> None:
    template, search = patches(True, level=level)
    expected = coefficients(template, search)
    np.testing.assert_allclose(correlate_grey(template, search), expected, atol=1e-3)


@pytest.mark.parametrize("strong", [1e2, 1e3, 1e4, 1e5, 1e6])
@pytest.mark.parametrize("which", [0, 1])
def test_masked_grey_values_beside_a_scatterer(which: int, strong: float) -> None:
    """The scatterer is seen by a few shifts, or by all except where it meets an invalid pixel."""
    both = patches(True)
    at = (SHAPE[0] // 2, SHAPE[1] // 2) if which == 0 else (1, 1)
    both[which].values[at], both[which].valid[at] = 20 * strong, True
    found = correlate_grey(*both)
    np.testing.assert_allclose(found, coefficients(*both), atol=1e-3)
    # Another chip in the same stack is unaffected.
    beside = patches(True, seed=5)
    stacks = [
        Patch(np.stack([p.values for p in side]), np.stack([p.valid for p in side]))
        for side in zip(beside, both, strict=True)
    ]
    np.testing.assert_array_equal(correlate_grey(*stacks), [correlate_grey(*beside), found])


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("unit", [1e-30, 1e-9, 1e30])
def test_grey_values_of_any_unit(masked: bool, unit: float) -> None:
    template, search = patches(masked)
    scaled = (Patch(patch.values * np.float32(unit), patch.valid) for patch in (template, search))
    expected = coefficients(template, search)
    np.testing.assert_allclose(correlate_grey(*scaled), expected, atol=1e-3)


def test_contrast_and_brightness_do_not_matter_but_inversion_does() -> None:
    template, search = patches(True)
    found = correlate_grey(template, search)
    brighter = Patch(np.where(search.valid, search.values * 3 + 40, 0), search.valid)
    np.testing.assert_allclose(correlate_grey(template, brighter), found, atol=1e-3)
    inverted = Patch(-search.values, search.valid)
    np.testing.assert_allclose(correlate_grey(template, inverted), -found, atol=1e-3)


@pytest.mark.parametrize("what", ["flat template", "flat search", "nothing valid"])
def test_windows_without_content_give_finite_values(what: str) -> None:
    template, search = patches(True)
    flat = {
        "flat template": (Patch(np.full_like(template.values, 7), template.valid), search),
        "flat search": (template, Patch(np.full_like(search.values, 7), search.valid)),
        "nothing valid": (Patch(template.values, template.valid & False), search),
    }[what]
    found = correlate_grey(*flat)
    assert np.isfinite(found).all()
    assert np.abs(found).max() < 0.05


def test_box_sums() -> None:
    image = np.random.default_rng(0).uniform(0, 9, SIZE).astype(np.float32)
    np.testing.assert_allclose(
        box_sums(image, *SHAPE), windows_of(image).sum(axis=(2, 3)), rtol=1e-5
    )


def test_box_sums_of_a_stack_see_nothing_of_its_other_images() -> None:
    images = np.random.default_rng(0).uniform(0, 9, (3, *SIZE)).astype(np.float32)
    images[1] *= 1e4
    expected = [windows_of(image).sum(axis=(2, 3)) for image in images]
    np.testing.assert_allclose(box_sums(images, *SHAPE), expected, rtol=1e-5)


@pytest.mark.parametrize("masked", [False, True])
def test_overlap_is_the_share_of_the_template_that_meets_valid_pixels(masked: bool) -> None:
    template, search = patches(masked)
    both = windows_of(search.valid) & template.valid
    expected = both.sum(axis=(2, 3)) / template.valid.sum()
    np.testing.assert_allclose(overlap_share(template, search), expected, atol=1e-5)
    half = Patch(search.values, np.arange(SIZE[1])[None, :].repeat(SIZE[0], 0) < SIZE[1] // 2)
    full = Patch(template.values, np.ones(SHAPE, bool))
    expected = windows_of(half.valid).mean(axis=(2, 3))
    np.testing.assert_allclose(overlap_share(full, half), expected, atol=1e-6)
