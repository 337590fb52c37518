"""Radar images of fields and a forest whose canopies stand elsewhere in another image."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from raster_files import utm_grid, write_raster
from scipy.ndimage import gaussian_filter
from speckled_pairs import speckled

FloatImage = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Side of a field, and of a crown, and what crowns and the gaps between them differ by.
_FIELD_PX, _CROWN_PX, _CROWN_DB = 60, 2.0, 6.0


@dataclass(frozen=True)
class Country:
    """Fields as bright as each other within 3 dB, with a forest.

    Parameters
    ----------
    level_db
        Of the ground, shape (h, w).
    crowns_db
        Of canopies all over, same shape.
    is_forest
        Where they stand, same shape.
    """

    level_db: FloatImage
    crowns_db: FloatImage
    is_forest: Mask

    @property
    def is_border(self) -> Mask:
        """Where two fields meet, same shape."""
        rows, cols = (np.abs(np.diff(self.level_db, axis=axis)) > 0 for axis in (0, 1))
        return np.pad(rows, ((0, 1), (0, 0))) | np.pad(cols, ((0, 0), (0, 1)))

    def seen(self, canopies_px: int, looks: float, seed: int) -> FloatImage:
        """Return an amplitude image in which canopies are displaced to the left."""
        forest = np.roll(self.is_forest, -canopies_px, axis=1)
        level = np.where(forest, np.roll(self.crowns_db, -canopies_px, axis=1), self.level_db)
        return speckled(np.asarray(300 * 10 ** (level / 20)), looks, seed)


def draw_country(size: int, forest_share: float, seed: int = 0) -> Country:
    """Draw fields, of which a share of the size, from the left, is forest."""
    random = np.random.default_rng(seed)
    fields = random.uniform(-6, 6, (size // _FIELD_PX + 2,) * 2).astype(np.float32)
    level = np.kron(fields, np.ones((_FIELD_PX, _FIELD_PX), np.float32))[:size, :size]
    # Fields lie askew, as lines along rows and columns are a grid's.
    askew = cv2.getRotationMatrix2D((size / 2, size / 2), 20, 1.0)
    level = cv2.warpAffine(
        level, askew, (size, size), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REFLECT
    )
    crowns = gaussian_filter(random.normal(size=(size, size)), _CROWN_PX)
    forest = np.zeros((size, size), bool)
    forest[:, : round(forest_share * size)] = True
    crowns_db = 4 + _CROWN_DB * crowns / crowns.std()
    return Country(level, crowns_db.astype(np.float32), forest)


def forest_files(folder: Path, forest_share: float, seed: int) -> tuple[Path, Path]:
    """Write fields and a forest, seen twice: canopies 8 px elsewhere.

    The input's geotransform is wrong by (5, -3) px: pixels that belong together are the same.
    """
    country, grid = draw_country(420, forest_share, seed), utm_grid(420, 420, 1.0)
    return (
        write_raster(folder / "a.tif", country.seen(0, 4.0, 1), grid),
        write_raster(folder / "b.tif", country.seen(8, 4.0, 2), grid.window(5, -3, 420, 420)),
    )
