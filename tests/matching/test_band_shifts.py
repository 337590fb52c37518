"""Bands of one file that are displaced against the band before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster
from scipy.ndimage import gaussian_filter
from textured_pairs import texture

from groundtie.matching.band_shifts import BandShift, band_shifts
from groundtie.rasters.reading import open_raster

SHIFT = (-4, 9)


def found_in(path: Path) -> list[BandShift]:
    """Return the displaced bands."""
    with open_raster(path) as source:
        return [one for one in band_shifts(source) if one.apart_px > 2]


def moved(band: np.ndarray, shift: tuple[int, int] = SHIFT) -> np.ndarray:
    """Return a band with its content displaced by rows and columns."""
    return np.roll(band, shift, axis=(0, 1))


@pytest.fixture
def bands() -> np.ndarray:
    """Return three bands of one ground, with different contrast and independent noise."""
    ground, rng = 128 + 40 * texture(400, 420), np.random.default_rng(4)
    noise = 3 * rng.normal(size=(3, 400, 420))
    return np.stack([ground, 255 - 0.7 * ground, 20 + 0.4 * ground]) + noise


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_band_that_was_moved_is_found_and_how_far(
    bands: np.ndarray, number: int, tmp_path: Path
) -> None:
    bands[number - 1] = moved(bands[number - 1])
    found = found_in(write_raster(tmp_path / "i.tif", bands.astype(np.float32)))
    # All bands are compared with the first.
    expected = [(1, 2), (1, 3)] if number == 1 else [(1, number)]
    assert [one.bands for one in found] == expected
    assert [one.apart_px for one in found] == pytest.approx(
        [np.hypot(*SHIFT)] * len(expected), abs=0.2
    )


@pytest.mark.parametrize("between", ["nothing", "noise"])
def test_a_band_that_shows_no_ground_hides_no_shift(
    bands: np.ndarray, between: str, tmp_path: Path
) -> None:
    noise = np.random.default_rng(6).normal(100, 20, size=bands.shape[1:])
    bands[1] = 7 if between == "nothing" else noise
    bands[2] = moved(bands[2])
    (found,) = found_in(write_raster(tmp_path / "i.tif", bands.astype(np.float32)))
    assert found.bands == (1, 3) and found.apart_px == pytest.approx(np.hypot(*SHIFT), abs=0.2)


@pytest.mark.parametrize("shift", [(1, 1), (2, 2), (0, 3)])
def test_small_shifts_add_up(shift: tuple[int, int], tmp_path: Path) -> None:
    ground, rng = 128 + 40 * texture(400, 420), np.random.default_rng(4)
    drifted = [moved(ground, (k * shift[0], k * shift[1])) for k in range(6)]
    noisy = np.stack(drifted) + 3 * rng.normal(size=(6, 400, 420))
    last = found_in(write_raster(tmp_path / "i.tif", noisy.astype(np.float32)))[-1]
    assert last.bands == (1, 6) and last.apart_px == pytest.approx(5 * np.hypot(*shift), abs=0.5)


@pytest.mark.parametrize("sigma_px", [3.0, 6.0, 10.0])
def test_heights_and_their_shading_are_not_displaced(sigma_px: float, tmp_path: Path) -> None:
    """Edges of heights lie where slopes are steep, those of the shading where slopes change."""
    noise = np.random.default_rng(7).normal(size=(400, 420))
    heights = gaussian_filter(noise, sigma_px)
    heights *= 3 * sigma_px / heights.std()
    down, right = np.gradient(heights)
    shading = (1 - right + down) / np.sqrt(3 * (1 + right**2 + down**2))
    stack = np.stack([heights, 255 * np.clip(shading, 0, 1)])
    assert found_in(write_raster(tmp_path / "i.tif", stack.astype(np.float32))) == []


def test_bands_at_their_place_are_not_displaced(bands: np.ndarray, tmp_path: Path) -> None:
    assert found_in(write_raster(tmp_path / "i.tif", bands.astype(np.float32))) == []


def test_bands_of_noise_or_of_nothing_are_not_displaced(tmp_path: Path) -> None:
    noise = np.random.default_rng(5).normal(100, 20, size=(5, 200, 300))
    noise[3] = 7
    assert found_in(write_raster(tmp_path / "i.tif", noise.astype(np.float32))) == []


def test_the_edges_of_nodata_hide_no_shift(bands: np.ndarray, tmp_path: Path) -> None:
    """All bands have the same nodata wedge, which is not displaced."""
    bands[2] = moved(bands[2])
    rows, cols = np.indices(bands.shape[1:])
    bands[:, rows + cols < 250] = 0
    path = write_raster(tmp_path / "i.tif", bands.astype(np.float32), nodata=0)
    (found,) = found_in(path)
    assert found.bands == (1, 3) and found.apart_px == pytest.approx(np.hypot(*SHIFT), abs=0.2)


@pytest.mark.parametrize("shape", [(1, 300, 300), (3, 20, 300)])
def test_one_band_and_strips_are_not_compared(shape: tuple[int, ...], tmp_path: Path) -> None:
    path = write_raster(tmp_path / "i.tif", np.ones(shape, np.uint8))
    assert found_in(path) == []


@pytest.mark.parametrize(
    "name",
    [
        "so-cloudy-sentinel/s2_cloudfree_ROIs1970_fall_139_p839.tif",
        "so-cloudy-sentinel/s2_cloudy_ROIs1970_fall_139_p839.tif",
        "so-cloudy-sentinel/ROIs1970_fall_139_p839.tif",
        "so-sentinel/S2_patch11.tif",
        "oo-burn/burn_1986.png",
        "dn-1/DN1a.png",
        "oi-3/IO3b.png",
        "so-forest-river/SO3a.png",
        "rpc-ventoux/lowres_color_image.tif",
    ],
)
def test_bands_of_real_images_are_not_displaced(name: str, real_data: Path) -> None:
    assert found_in(real_data / name) == []


@pytest.mark.parametrize(
    "name", ["so-delta/SO1a.png", "so-dense-urban/optical_ref.png", "oo-port/OO4a.png"]
)
def test_displaced_bands_of_real_images_are_found(
    name: str, real_data: Path, tmp_path: Path
) -> None:
    with open_raster(real_data / name) as source:
        bands, _ = source.read_bands(source.window, (1, 2, 3))
    bands[2] = moved(bands[2], (5, -4))
    (found,) = found_in(write_raster(tmp_path / "i.tif", bands))
    assert found.bands == (1, 3) and found.apart_px == pytest.approx(np.hypot(5, 4), abs=0.5)


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_bands_of_small_images_are_compared_all_over(
    bands: np.ndarray, corner: tuple[int, int], tmp_path: Path
) -> None:
    """One window would lie in the corner without data."""
    bands[1] = moved(bands[1])
    small = bands[:, :380, :380].astype(np.float32)
    rows, cols = (slice(190 * at, 190 * at + 190) for at in corner)
    small[:, rows, cols] = -1
    (found,) = found_in(write_raster(tmp_path / "i.tif", small, nodata=-1))
    assert found.bands == (1, 2) and found.apart_px == pytest.approx(np.hypot(*SHIFT), abs=0.3)
