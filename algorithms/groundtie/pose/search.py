"""The exhaustive search for a pose: all rotations and scales in steps, all shifts at once.

The search runs from coarse to fine: every rotation and scale is tried on small images; the best
candidates are refined in finer steps on larger images, and compared with one another on the way.
Similarity is the correlation of squared orientation fields. It is quick over all shifts and does
not depend on contrast, which differs between SAR and optical images. Source: [Patel2017],
section 3.2.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..context import Context
from ..geometry.limits import SearchLimits
from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..similarity.correlation import MINIMUM_OVERLAP
from ..similarity.order_statistics import robust_deviation
from ..similarity.surface import Surface
from .pose import Pose, PoseFound
from .rotation_fields import Template
from .rotation_levels import HEIGHT, Climber, Level

# Side of the small images on which all poses are tried, in pixels (geometric mean of both images).
_COARSE_SIDE_PX = 96

# Number of candidates that are refined on each finer level, of half the pixel size. More levels do
# not change the result.
_KEPT = (32, 8)

# Displacement by one step of rotation at a quarter of the side from the centre, in pixels; steps a
# third larger miss fine structure. Fields are less sensitive to scale by a quarter.
_STEP_PX = 1.7
_SCALE_STEP = 1.25

# Poses are the same if they move the reference's corners by less than this share of its side.
_SAME_SHARE = 0.06

# Radius of the surface whose spread is one standard deviation of chance, in pixels of the finest
# level; even.
_BACKGROUND_PX = 32


@dataclass(frozen=True)
class Scan:
    """Heights of the best matches at every rotation and scale, on small images.

    Parameters
    ----------
    rotations_deg, scales
        The steps, ascending, shapes (r,) and (s,).
    heights
        Height at the best of all shifts, in standard deviations of chance, shape (s, r).
    found
        The best candidates, best first; their heights are in the unit of `heights`.
    """

    rotations_deg: FloatArray
    scales: FloatArray
    heights: FloatArray
    found: tuple[PoseFound, ...]


def find_poses(
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    context: Context,
) -> list[PoseFound]:
    """Return candidates for the pose of an input window in a reference window, best first.

    Parameters
    ----------
    reference, input
        The windows; their sizes may differ, their centres are compared.
    limits
        Limits of the searched rotation, scale and shift (in input pixels).
    context
        Threads to work in.

    Returns
    -------
    Different candidates; none if a window is flat. Their heights are compared at the same pixel
    size, so that the ratio of the first two measures how unlikely a mistake is.
    """
    if reference.is_flat or input.is_flat:
        return []
    return _Search(reference, input, limits, context.quiet()).run()


def scan(reference: Patch, input: Patch, limits: SearchLimits, context: Context) -> Scan:
    """Try all rotations and scales within limits on small images."""
    return _Search(reference, input, limits, context.quiet()).scan()


def shift_surface(
    reference: Patch, input: Patch, pose: Pose, context: Context
) -> tuple[Surface, float]:
    """Return the similarity surface around a pose, and its pixel size in reference pixels.

    The surface has the shape (2 r + 1, 2 r + 1); its values are robust standard deviations.
    """
    limits = SearchLimits(0.0, 0.0, (pose.scale, pose.scale))
    search = _Search(reference, input, limits, context.quiet())
    level = search.level(search.fine_px, [pose.scale])
    surface = level.surface(Template(level.reference, _BACKGROUND_PX), pose)
    return surface / np.float32(_spread(surface)), level.pixel_px


def moved_px(one: Pose, other: Pose, shape: tuple[int, int]) -> float:
    """Return the distance of a reference's corners under two poses, in reference pixels (RMS)."""
    rows, cols = shape
    corners = np.array([[x, y] for x in (-cols / 2, cols / 2) for y in (-rows / 2, rows / 2)])
    apart = corners @ (one.linear - other.linear).T + np.subtract(one.shift_px, other.shift_px)
    return float(np.sqrt((apart**2).sum(axis=1).mean()) / one.scale)


@dataclass(frozen=True)
class _Search:
    reference: Patch
    input: Patch
    limits: SearchLimits
    context: Context

    @cached_property
    def side_px(self) -> float:
        """Geometric mean of the images' longer sides, in reference pixels."""
        own, other = (max(patch.values.shape) for patch in (self.reference, self.input))
        return float(np.sqrt(own * other / np.sqrt(np.prod(self.limits.scale))))

    @property
    def coarse_px(self) -> float:
        """Pixel size of the small images, in reference pixels."""
        return max(self.side_px / _COARSE_SIDE_PX, 1.0)

    @property
    def fine_px(self) -> float:
        """Pixel size of the largest images, in reference pixels."""
        return max(self.side_px / (_COARSE_SIDE_PX * 2 ** len(_KEPT)), 1.0)

    @property
    def whole_circle(self) -> bool:
        return self.limits.rotation_deg >= 180

    @property
    def steps(self) -> tuple[float, float]:
        """Steps of rotation (degrees) and of log2 of the scale on the small images."""
        angle = _STEP_PX * self.coarse_px / (self.side_px / 4)
        return float(np.degrees(angle)), _SCALE_STEP * angle / float(np.log(2))

    def run(self) -> list[PoseFound]:
        found: Sequence[PoseFound] = self.scan().found
        (rotation, scale), pixel_px = self.steps, self.coarse_px
        for kept in _KEPT:
            if not found:
                return []
            pixel_px = max(pixel_px / 2, self.fine_px)
            rotation, scale = rotation / 2, scale / 2
            level = self.level(pixel_px, [candidate.pose.scale for candidate in found[:kept]])
            climber = Climber(level, rotation, scale, self.limits)
            found = self.distinct(self.context.map(climber.climb, found[:kept]))
            if pixel_px == self.fine_px:
                break
        best = climber.climb_finely(found[0])
        chance = _spread(level.surface(Template(level.reference, _BACKGROUND_PX), best.pose))
        return [
            PoseFound(candidate.pose, candidate.height / chance) for candidate in (best, *found[1:])
        ]

    def scan(self) -> Scan:
        rotations, scales = self.rotations_deg(), self.scales()
        level = self.level(self.coarse_px, scales)
        # A second peak reveals repetitive structure; a search with few steps keeps several at each.
        peaks = max(2 * _KEPT[0] // (len(rotations) * len(scales)), 2)

        def at_scale(scale: float) -> list[list[PoseFound]]:
            template = Template(level.reference, self.radius(level, scale))
            poses = [Pose(float(rotation), scale) for rotation in rotations]
            surfaces = self.surfaces(level, template, poses)
            pairs = zip(surfaces, poses, strict=True)
            return [
                level.peaks(surface, pose, self.limits.radius, peaks) for surface, pose in pairs
            ]

        # Every registration imports this module, but few search for poses.
        from scipy.ndimage import maximum_filter

        rows = list(self.context.map(at_scale, scales.tolist()))
        heights = np.array([[found[0].height for found in row] for row in rows])
        modes = "constant", "wrap" if self.whole_circle else "constant"
        tops = np.argwhere(heights >= maximum_filter(heights, 3, mode=modes, cval=-np.inf))
        found = [one for i, j in tops for one in rows[i][j] if one.height > 0]
        return Scan(rotations, scales, heights, tuple(_best_first(found)))

    def surfaces(self, level: Level, template: Template, poses: Sequence[Pose]) -> list[Surface]:
        """Return the surfaces of all rotations at one scale."""
        if not self.whole_circle:
            return [level.surface(template, pose) for pose in poses]
        field = level.input(poses[0].scale)
        pairs = [template.surfaces_both_ways(field, pose) for pose in poses[: len(poses) // 2]]
        return [one for one, _ in pairs] + [other for _, other in pairs]

    def level(self, pixel_px: float, scales: Iterable[float]) -> Level:
        return Level.of(self.reference, self.input, pixel_px, scales, self.context)

    def rotations_deg(self) -> FloatArray:
        step = self.steps[0]
        if self.whole_circle:
            half = int(np.ceil(180 / step))
            return np.asarray(180 / half * np.arange(-half, half))
        largest = self.limits.rotation_deg
        return np.linspace(-largest, largest, int(np.ceil(2 * largest / step - 1e-9)) + 1)

    def scales(self) -> FloatArray:
        low, high = np.log2(self.limits.scale)
        count = int(np.ceil((high - low) / self.steps[1] - 1e-9)) + 1
        return np.asarray(np.exp2(np.linspace(low, high, count)))

    def radius(self, level: Level, scale: float) -> int:
        """Return the radius in pixels of a level that covers all shifts at a scale; even."""
        own, other = max(self.reference.values.shape), max(self.input.values.shape) / scale
        useful = (own + other) / 2 - MINIMUM_OVERLAP * min(own, other)
        # The limits are along the input's rows and columns, which may be rotated.
        across = np.radians(min(self.limits.rotation_deg, 45.0))
        wanted = self.limits.radius / scale * (np.cos(across) + np.sin(across))
        return 2 * int(np.ceil(min(wanted, useful) / level.pixel_px / 2))

    def distinct(self, candidates: Iterable[PoseFound]) -> list[PoseFound]:
        """Return candidates, best first, without near duplicates of a better one."""
        kept: list[PoseFound] = []
        least = _SAME_SHARE * self.side_px
        shape = self.reference.values.shape[0], self.reference.values.shape[1]
        for candidate in _best_first(candidates):
            if all(moved_px(candidate.pose, other.pose, shape) > least for other in kept):
                kept.append(candidate)
        return kept


def _spread(surface: Surface) -> float:
    """Return the robust standard deviation of a surface, above zero."""
    return max(robust_deviation(surface), 1e-9)


def _best_first(found: Iterable[PoseFound]) -> list[PoseFound]:
    return sorted(found, key=HEIGHT, reverse=True)
