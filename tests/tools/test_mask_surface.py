from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio

import groundtie
from groundtie.errors import ParameterError
from groundtie.masks.surface_model import Reason
from groundtie.registration.surface_masks import CLEAR_CORRELATION

CAMERA = "camera azimuth=250 incidence=12 sun-azimuth=155 sun-elevation=48"


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("city")
    groundtie.simulate(folder, size=200, density="city", seed=3)
    return folder


def read(path: Path) -> np.ndarray:
    with rasterio.open(path) as raster:
        return raster.read(1)


@pytest.mark.slow
def test_what_has_a_reason_takes_no_part(city: Path, tmp_path: Path) -> None:
    mask, reasons = tmp_path / "mask.tif", tmp_path / "reasons.tif"
    found = groundtie.mask_surface(
        city / "reference.tif", city / "dsm.tif", mask, reasons=reasons, views=f"; {CAMERA}"
    )
    np.testing.assert_array_equal(read(mask) > 0, read(reasons) == 0)
    assert found.share == pytest.approx(np.mean(read(mask)), abs=1e-6)
    assert found.numbers["correlation"] > CLEAR_CORRELATION
    assert found.files == {"mask": str(mask), "reasons": str(reasons)}
    assert all((read(reasons) & reason).any() for reason in Reason if reason != Reason.UNKNOWN)


@pytest.mark.slow
def test_words_and_the_item_state_the_same_view(city: Path, tmp_path: Path) -> None:
    shares = [
        groundtie.mask_surface(
            city / "reference.tif", city / "dsm.tif", tmp_path / "mask.tif", views=f"; {view}"
        ).share
        for view in (CAMERA, str(city / "input.json"))
    ]
    assert shares[0] == shares[1]


@pytest.mark.slow
def test_without_the_other_view_only_the_references_own_is_masked(
    city: Path, tmp_path: Path
) -> None:
    reasons = tmp_path / "reasons.tif"
    found = groundtie.mask_surface(
        city / "reference.tif", city / "dsm.tif", tmp_path / "mask.tif", reasons=reasons
    )
    camera = Reason.HIDDEN | Reason.CAST_SHADOW
    assert not (read(reasons) & camera).any()
    assert found.summary()["share"] > 0.1 and "take part" in found.lines()[0]


def test_a_reference_without_a_view_is_refused(city: Path, tmp_path: Path) -> None:
    alone = tmp_path / "alone.tif"
    alone.write_bytes((city / "reference.tif").read_bytes())
    with pytest.raises(ParameterError, match="view of the reference is not known"):
        groundtie.mask_surface(alone, city / "dsm.tif", tmp_path / "mask.tif")
    assert not (tmp_path / "mask.tif").exists()


def test_help_does_not_ask_for_both_views() -> None:
    """One view is enough: see `test_without_the_other_view_only_the_references_own_is_masked`."""
    assert "Needs the views of both images" not in (groundtie.mask_surface.__doc__ or "")
