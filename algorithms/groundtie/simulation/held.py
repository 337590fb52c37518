"""Memory needs of a simulation, which holds its whole scene and both images in memory."""

from __future__ import annotations

from ..memory import require_bytes
from ..rasters.grid import Grid

# Bytes for libraries and per pixel of the input; and per pixel of the scene with its surroundings,
# for a pair and for an image in sensor geometry. They agree to within a tenth with the measurements
# of `benchmarks/run.py --only memory`.
_LIBRARIES_BYTES, _IMAGE_BYTES = 150e6, 30
PAIR_BYTES, SENSOR_BYTES = 35, 45


def require_memory(scene: Grid, image: Grid, scene_bytes: int) -> None:
    """Stop if a simulation needs more memory than the budget.

    Parameters
    ----------
    scene
        The grid of the scene with its surroundings.
    image
        The grid of the input.
    scene_bytes
        Bytes per pixel of the scene: `PAIR_BYTES` or `SENSOR_BYTES`.

    Raises
    ------
    MemoryLimitError
        It needs more.
    """
    needed = _LIBRARIES_BYTES
    needed += scene_bytes * scene.width * scene.height + _IMAGE_BYTES * image.width * image.height
    require_bytes(needed, f"a scene of {scene.width} × {scene.height} px with its surroundings")
