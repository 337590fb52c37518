"""Masks that lie beside an image are found by the missions' names, and by no others."""

from __future__ import annotations

from pathlib import Path

import pytest

from groundtie.masks.beside import mask_beside

S2 = "T32UQD_20200620T101031"
L8 = "LC08_L2SP_193026_20200621_20200823_02_T1"
HLS = "HLS.S30.T32UQD.2020172T101031.v2.0"
PLANET = "20200620_094512_45_2415_3B"


@pytest.mark.parametrize(
    ("image", "mask", "scheme"),
    [
        (f"R10m/{S2}_B08_10m.jp2", f"R20m/{S2}_SCL_20m.jp2", "scl"),
        (f"R10m/{S2}_TCI_10m.jp2", f"R60m/{S2}_SCL_60m.jp2", "scl"),
        (f"{S2}_B8A_20m.tif", f"{S2}_SCL_20m.tif", "scl"),
        (f"{L8}_SR_B4.TIF", f"{L8}_QA_PIXEL.TIF", "qa-pixel"),
        (f"{HLS}.B04.tif", f"{HLS}.Fmask.tif", "hls-fmask"),
        (f"{PLANET}_AnalyticMS_SR_8b_clip.tif", f"{PLANET}_udm2_clip.tif", "udm2"),
        (f"{PLANET}_AnalyticMS.tif", f"{PLANET}_udm2.tif", "udm2"),
    ],
)
def test_what_missions_call_their_masks(tmp_path: Path, image: str, mask: str, scheme: str) -> None:
    assert mask_beside(tmp_path / image) is None
    (tmp_path / mask).parent.mkdir(exist_ok=True)
    (tmp_path / mask).touch()
    found = mask_beside(tmp_path / image)
    assert found is not None
    assert (found[0].resolve(), found[1]) == ((tmp_path / mask).resolve(), scheme)


@pytest.mark.parametrize(
    ("image", "mask"),
    [
        (f"{S2}_B04_10m.jp2", "T33UQD_20200620T101031_SCL_20m.jp2"),
        (f"{S2}_B04_10m_clipped.jp2", f"{S2}_SCL_20m.jp2"),
        (f"{S2}_SCL_20m.jp2", f"{S2}_SCL_20m.jp2"),
        ("B04.tif", "SCL.tif"),
        ("image.tif", "image_udm2.tif"),
        (f"{PLANET}_AnalyticMS_clip.tif", f"{PLANET}_udm2.tif"),
    ],
)
def test_other_names_are_mistakable(tmp_path: Path, image: str, mask: str) -> None:
    (tmp_path / mask).touch()
    assert mask_beside(tmp_path / image) is None
