from __future__ import annotations

import numpy as np
import pytest

from groundtie.rasters.colours import Colours

ALL = np.ones((60, 60), bool)


def bands(contrast: float, seed: int = 0) -> np.ndarray:
    """Three bands of one mean, of which the left half is redder than the right."""
    red = np.where(np.arange(60) < 30, 1 + contrast, 1 - contrast) * np.ones((60, 1))
    noise = np.random.default_rng(seed).normal(0, 2, (3, 60, 60))
    return np.stack([300 * red, np.full((60, 60), 300.0), 300 * (2 - red)]) + noise


def classes(colours: Colours, image: np.ndarray) -> np.ndarray:
    return colours.classes(colours.measured(image))


def test_what_is_as_bright_but_of_other_colour_has_other_classes() -> None:
    image = bands(0.2)
    numbers = classes(Colours.of(image, ALL), image)
    assert numbers.dtype == np.float32
    assert not set(np.unique(numbers[:, :30])) & set(np.unique(numbers[:, 30:]))


def test_classes_are_numbered_from_1_and_parted_by_the_edges() -> None:
    image = np.random.default_rng(0).gamma(4, 100, (4, 60, 60))
    colours = Colours.of(image, ALL)
    numbers = classes(colours, image)
    assert numbers.min() == 1 and numbers.max() == len(colours.edges) + 1 == 48
    np.testing.assert_array_equal(np.searchsorted(colours.edges, numbers) + 1, numbers)


def test_shadow_changes_no_hue() -> None:
    image = bands(0.2)
    shaded = image * np.where(np.arange(60) % 2, 1.0, 0.3)
    colours = Colours.of(shaded, ALL)
    hue = (classes(colours, shaded) - 1) % 4
    # Noise of 2 of 300, or of 90 in shadow, against 20 % of colour.
    assert len(set(np.unique(hue[:, :30])) & set(np.unique(hue[:, 30:]))) == 0


def test_invalid_pixels_make_no_classes() -> None:
    image = bands(0.2)
    valid = ALL.copy()
    valid[:20] = False
    spoilt = image.copy()
    spoilt[:, :20] = 60_000
    expected, found = Colours.of(image[:, 20:], ALL[20:]), Colours.of(spoilt, valid)
    np.testing.assert_array_equal(found.brightness_edges, expected.brightness_edges)
    np.testing.assert_array_equal(found.hue_edges, expected.hue_edges)


@pytest.mark.parametrize("value", [0.0, 255.0])
def test_an_image_of_one_colour_has_one_class(value: float) -> None:
    image = np.full((3, 60, 60), value)
    assert len(np.unique(classes(Colours.of(image, ALL), image))) == 1
