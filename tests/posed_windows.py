"""Windows of a generated ground in a known pose, without any resampling."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from groundtie.pose.pose import Pose, PoseFound
from groundtie.rasters.patch import Patch

# Waves of the ground: how many, and the shortest and longest, in reference pixels.
_WAVES = 150
_LENGTHS_PX = (5.0, 60.0)


def ground(px: NDArray[np.float64], seed: int = 0) -> NDArray[np.float32]:
    """Return the grey values, all positive, at positions (right, down), shape (2, h, w)."""
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(*np.log(_LENGTHS_PX), _WAVES))
    direction, phase = rng.uniform(0, 2 * np.pi, (2, _WAVES))
    along = 2 * np.pi / length * np.array([np.cos(direction), np.sin(direction)])
    # What is far off is not a repetition: frequencies are drawn, not taken from a lattice.
    px = px.astype(np.float32)
    total = np.zeros(px.shape[1:], np.float32)
    for (right, down), start in zip(
        along.T.astype(np.float32), phase.astype(np.float32), strict=True
    ):
        total += np.cos(right * px[0] + down * px[1] + start)
    return (100 * np.exp(0.5 * total / np.sqrt(_WAVES / 2))).astype(np.float32)


def window(
    shape: tuple[int, int], pose: Pose | None = None, seed: int = 0, noise: float = 0.0
) -> Patch:
    """Return a window whose content lies as `pose` says against that of `window(…)` without it."""
    pose = pose or Pose()
    rows, cols = np.indices(shape, float)
    from_centre = np.stack([cols - (shape[1] - 1) / 2, rows - (shape[0] - 1) / 2])
    moved = from_centre - np.array(pose.shift_px)[:, None, None]
    values = ground(np.einsum("ij,jkl->ikl", np.linalg.inv(pose.linear), moved), seed)
    values += noise * np.random.default_rng(seed + 1).normal(size=shape).astype(np.float32)
    return Patch(values, np.ones(shape, bool))


def masked(patch: Patch, rows: slice, cols: slice) -> Patch:
    """Return a window with a rectangle masked, and an absurd grey value in it."""
    values, valid = patch.values.copy(), patch.valid.copy()
    values[rows, cols], valid[rows, cols] = 1e6, False
    return Patch(values, valid)


def turned_by(found: PoseFound, truth: Pose) -> float:
    """Return the error of a rotation in degrees."""
    return abs((found.pose.rotation_deg - truth.rotation_deg + 180) % 360 - 180)


def shifted_by(found: PoseFound, truth: Pose) -> float:
    """Return the larger error of a shift along rows and columns, in pixels."""
    return float(np.abs(np.subtract(found.pose.shift_px, truth.shift_px)).max())


def error_px(found: PoseFound, truth: Pose, shape: tuple[int, int]) -> float:
    """Return the root mean square error over a reference of a shape, in its pixels."""
    sides = [np.linspace(-0.5, 0.5, 11) * n for n in shape[::-1]]
    px = np.stack(np.meshgrid(*sides), -1).reshape(-1, 2)
    off = px @ (found.pose.linear - truth.linear).T + np.subtract(
        found.pose.shift_px, truth.shift_px
    )
    return float(np.sqrt((off**2).sum(axis=1).mean())) / truth.scale
