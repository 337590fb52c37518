"""How much memory a simulation takes: it holds its whole scene, and the images of it."""

from __future__ import annotations

from ..memory import require_bytes
from ..rasters.grid import Grid

# What is taken for libraries; for each pixel of the scene with its surroundings, by a pair and by
# an image in sensor geometry; and for each pixel of the input: within a tenth of what
# `benchmarks/run.py --only memory` measures.
_LIBRARIES_BYTES, _IMAGE_BYTES = 150e6, 30
PAIR_BYTES, SENSOR_BYTES = 35, 45


def require_memory(scene: Grid, image: Grid, scene_bytes: int) -> None:
    """Stop if a simulation takes more than the budget.

    Parameters
    ----------
    scene
        The grid of the scene with its surroundings.
    image
        That of the input.
    scene_bytes
        For each pixel of the scene: `PAIR_BYTES` or `SENSOR_BYTES`.

    Raises
    ------
    MemoryLimitError
        It does.
    """
    needed = _LIBRARIES_BYTES
    needed += scene_bytes * scene.width * scene.height + _IMAGE_BYTES * image.width * image.height
    require_bytes(needed, f"a scene of {scene.width} × {scene.height} px with its surroundings")
