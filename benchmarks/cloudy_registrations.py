"""Whole registrations of images under simulated clouds, with and without a classifier."""

from __future__ import annotations

import tempfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray

import groundtie

from .attempt import Outcome, Pair, attempt
from .cases import RealCase, draw_shift, read_image, search_radius_m, write_case, write_image
from .clouds import Clouds, clouds_over
from .real import LARGEST_SHIFT_PX

TOOLS = ("match_optical", "coregister")

# Cloud cover of the input: larger than where only some matches are lost.
SHARE = 0.5


@dataclass(frozen=True)
class CloudyRegistration:
    """A georeferenced pair with a wrong shift, its input under clouds.

    The classifier is trained on the same image under other clouds, which favours it as much as
    possible.
    """

    case: RealCase
    tool: str
    classified: bool

    @property
    def group(self) -> str:
        """Return the group that the case is counted in."""
        return f"{self.tool}, {'classifier' if self.classified else 'no classifier'}"

    def run(self, workers: int | None) -> Outcome:
        """Register the pair and judge the result."""
        case = self.case
        with tempfile.TemporaryDirectory() as folder:
            shift = draw_shift(case, LARGEST_SHIFT_PX, 0)
            pair = write_case(case, shift, Path(folder))
            parameters: dict[str, Any] = {}
            if self.classified:
                parameters["input_mask"] = _classifier(pair, case, Path(folder))
            clear = read_image(pair.input)
            _overwrite(pair.input, _clouds(clear, case, 0).over(clear.astype(np.float32)))
            return attempt(
                case.name,
                self.group,
                pair,
                workers,
                tool=self.tool,
                search_radius=search_radius_m(LARGEST_SHIFT_PX),
                **parameters,
            )


def _clouds(image: NDArray[Any], case: RealCase, draw: int) -> Clouds:
    grey = image.mean(axis=0, dtype=np.float32)
    return clouds_over(grey, SHARE, zlib.crc32(case.name.encode()) + draw)


def _classifier(pair: Pair, case: RealCase, folder: Path) -> Path:
    """Train a classifier on the input under other clouds than it is registered with."""
    clear = read_image(pair.input)
    clouds = _clouds(clear, case, 1)
    image = write_image(clear, Affine.identity(), folder / "other.tif")
    _overwrite(image, clouds.over(clear.astype(np.float32)))
    mask = clouds.hidden[None].astype(np.uint8)
    labels = write_image(mask, Affine.identity(), folder / "clouds.tif")
    classifier = folder / "classifier.json"
    groundtie.train_feature_classifier(image, classifier, label_raster=labels)
    return classifier


def _overwrite(path: Path, values: NDArray[np.float32]) -> None:
    """Replace all bands of a raster of integers, clipped to its data type."""
    with rasterio.open(path, "r+") as target:
        limits = np.iinfo(target.dtypes[0])
        rounded = np.clip(np.rint(values), limits.min, limits.max)
        target.write(rounded.astype(target.dtypes[0]))
