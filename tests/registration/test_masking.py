"""What is asked of a pair's images before and after they are registered."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from groundtie.registration.masking import MaskRequest
from raster_files import utm_grid, write_raster

from groundtie.progress import SILENT
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster

SIZE = 400
NO_RADAR = "there is no radar image beside a camera's"


def scene(bright_share: float, noise: float, seed: int = 0) -> np.ndarray:
    """Return grey values of 50, a share of them bright in squares, with relative noise."""
    random = np.random.default_rng(seed)
    chosen = random.permutation(400).reshape(20, 20) < 400 * bright_share
    squares = np.kron(chosen, np.ones((20, 20)))
    return (50 + 200 * squares) * (1 + noise * random.normal(size=(SIZE, SIZE)))


def speckled(bright_share: float) -> np.ndarray:
    random = np.random.default_rng(1)
    return scene(bright_share, 0.0) * np.sqrt(random.gamma(1, 1, (SIZE, SIZE)))


CALM, CALM_TOWN = scene(0.02, 0.01), scene(0.25, 0.01)


@pytest.fixture
def pair(tmp_path: Path) -> Iterator[Callable[[np.ndarray, np.ndarray], ImagePair]]:
    """Return the function that opens two images of grey values as a pair."""
    with ExitStack() as stack:

        def opened(name: str, values: np.ndarray) -> Image:
            grid = utm_grid(SIZE, SIZE, 1.0)
            path = write_raster(tmp_path / name, values.astype(np.float32), grid)
            return Image(stack.enter_context(open_raster(path)))

        yield lambda one, other: make_pair(opened("a.tif", one), opened("b.tif", other))


def request(kind: str = "auto", image: str = "auto") -> MaskRequest:
    return MaskRequest(kind, image, None, 0.0, 0.0)


@pytest.mark.parametrize(
    ("reference", "input", "expected"),
    [
        (CALM_TOWN, CALM, True),
        (CALM, CALM_TOWN, True),
        (CALM, CALM, False),
        # Filters dim a town; so less is enough for doubt than for a mask.
        (scene(0.1, 0.01), CALM, True),
        (scene(0.08, 0.01), CALM, False),
        # Speckle tells the radar's: what the camera shows does not matter.
        (speckled(0.02), CALM_TOWN, False),
        (speckled(0.1), CALM, True),
        (speckled(0.25), speckled(0.25), False),
    ],
)
def test_what_shines_may_be_a_town(
    pair: Callable[[np.ndarray, np.ndarray], ImagePair],
    reference: np.ndarray,
    input: np.ndarray,
    expected: bool,
) -> None:
    images = pair(reference, input)
    assert request().may_hide_a_town(images, "none") == expected


@pytest.mark.parametrize("kind", ["regions", "layer"])
def test_a_town_whose_ground_was_matched_hides_nothing(
    pair: Callable[[np.ndarray, np.ndarray], ImagePair], kind: str
) -> None:
    assert not request().may_hide_a_town(pair(CALM_TOWN, CALM), kind)


def test_whoever_names_the_radar_image_is_believed(
    pair: Callable[[np.ndarray, np.ndarray], ImagePair],
) -> None:
    images = pair(CALM_TOWN, CALM)
    assert not request(image="input").may_hide_a_town(images, "none")
    with ExitStack() as stack:
        _, used = request().apply(images, stack, SILENT)
        assert (used.kind, used.reason) == ("none", NO_RADAR)
        _, used = request(image="reference").apply(images, stack, SILENT)
        assert (used.kind, used.image) in (("threshold", "reference"), ("regions", "reference"))
        _, used = request(image="input").apply(images, stack, SILENT)
        assert used.kind == "none" and "too few buildings" in used.reason


@pytest.mark.parametrize(
    ("reference", "image", "kind", "expected"),
    [
        # Named, or the ground of it matched: it is a radar's, and has no speckle.
        (CALM_TOWN, "reference", "none", True),
        (CALM_TOWN, "reference", "regions", True),
        (CALM_TOWN, "auto", "none", False),
        (CALM, "reference", "none", False),
        (CALM_TOWN, "reference", "layer", False),
        (speckled(0.25), "auto", "regions", False),
    ],
)
def test_the_ground_of_a_town_is_found_by_its_speckle(
    pair: Callable[[np.ndarray, np.ndarray], ImagePair],
    reference: np.ndarray,
    image: str,
    kind: str,
    expected: bool,
) -> None:
    assert request(image=image).lacks_speckle(pair(reference, CALM), kind) == expected
