"""Images of known content as scenes, in pixels of 1 m."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from raster_files import utm_grid, write_raster

from groundtie.masks.scene import Scene
from groundtie.rasters.reading import open_raster


def scene_of(path: Path, image: np.ndarray, **more: Any) -> Scene:
    """Write an image, shape (h, w), with options of `write_raster`, and open it as a scene."""
    write_raster(path, image, utm_grid(*image.shape[::-1], 1.0), **more)
    return Scene.of(open_raster(path))
