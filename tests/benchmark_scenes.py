"""A textured pair of images, an exact function of the ground, and the scene that shows it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from affine import Affine
from benchmark_cases import MATRIX, pixels, to_reference

from benchmarks.cases import RealCase, write_image
from benchmarks.offsets import Scene

SIZE = (200, 180)


def texture(px: np.ndarray) -> np.ndarray:
    """Grey values of reference positions, shape (n, 2): waves of many lengths, all positive."""
    generator = np.random.default_rng(5)
    angle, phase = generator.uniform(0, 2 * np.pi, (2, 40))
    per_px = 2 * np.pi / generator.uniform(6, 40, 40)
    waves = np.stack([np.cos(angle), np.sin(angle)]) * per_px
    return 120 + 2 * np.cos(px @ waves + phase).sum(axis=1)


def textured_scene(folder: Path, matrix: np.ndarray = MATRIX) -> Scene:
    """Write the pair and return its scene; `matrix` is what is said to be its truth."""
    px = pixels(SIZE)
    for name, positions in (("reference", px), ("input", to_reference(px))):
        image = texture(positions).reshape(1, *SIZE[::-1]).astype(np.float32)
        write_image(image, Affine.identity(), folder / f"{name}.tif")
    files = folder / "reference.tif", folder / "input.tif"
    return Scene(RealCase("texture", "sar-optical", *files, 0.5, matrix), folder)
