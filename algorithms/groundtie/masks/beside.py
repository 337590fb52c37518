"""Masks that a mission delivers with an image, found by the mission's file names."""

from __future__ import annotations

import re
from pathlib import Path

_SENTINEL_2 = re.compile(
    r"(T\d\d[A-Z]{3}_\d{8}T\d{6})_(?:B\w\w|TCI|AOT|WVP)_\d\dm\.(jp2|tiff?)", re.IGNORECASE
)
_LANDSAT = re.compile(
    r"(L[CEMOT]\d\d_L[12]\w{2}_\d{6}_\d{8}_\d{8}_02_\w\w)_(?:SR_|ST_)?B\d+\.(tiff?)", re.IGNORECASE
)
_HLS = re.compile(
    r"(HLS\.[LS]30\.T\d\d[A-Z]{3}\.\d{7}T\d{6}\.v\d\.\d)\.B\w\w\.(tiff?)", re.IGNORECASE
)
_PLANET = re.compile(
    r"(\d{8}_\d{6}_(?:\d\d_)?\w{4}_3B)_AnalyticMS(?:_SR)?(?:_8b)?(?:_harmonized)?(_clip)?\.(tiff?)",
    re.IGNORECASE,
)


def mask_beside(image: Path | str) -> tuple[Path, str] | None:
    """Return the mask of an image and the scheme of its values, if both have the mission's names.

    For schemes see `values.SCHEMES`. Sentinel-2 L2A has its classification in the folder of another
    pixel size. Only files on disk are searched for, as each query to a server costs a request.
    """
    if isinstance(image, str):
        return None
    return next((mask for mask in _candidates(image) if mask[0].is_file()), None)


def _candidates(image: Path) -> list[tuple[Path, str]]:
    name, folder = image.name, image.parent
    if found := _SENTINEL_2.fullmatch(name):
        names = [f"{found[1]}_SCL_{size}m.{found[2]}" for size in (20, 60)]
        folders = [folder, folder.parent / "R20m", folder.parent / "R60m"]
        return [(place / name, "scl") for name in names for place in folders]
    if found := _LANDSAT.fullmatch(name):
        return [(folder / f"{found[1]}_QA_PIXEL.{found[2]}", "qa-pixel")]
    if found := _HLS.fullmatch(name):
        return [(folder / f"{found[1]}.Fmask.{found[2]}", "hls-fmask")]
    if found := _PLANET.fullmatch(name):
        return [(folder / f"{found[1]}_udm2{found[2] or ''}.{found[3]}", "udm2")]
    return []
