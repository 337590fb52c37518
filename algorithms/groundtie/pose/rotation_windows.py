"""Windows of two rasters for the search for a pose, reduced and with a common nominal centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from affine import Affine

from ..errors import NoOverlapError
from ..geometry.fitting import fit_model
from ..geometry.limits import SearchLimits
from ..geometry.models import shift_model
from ..geometry.transform import Transform
from ..matching.matcher import MaskOf
from ..rasters.grid import FloatArray, Grid, apply_affine, compose
from ..rasters.pair import Image, require_content, require_georeferenced_alike
from ..rasters.patch import Patch
from .pose import Pose

# Longest side of windows, in pixels; larger ones are averaged.
LONGEST_PX = 512

# Default of the input's largest displacement, as a share of its longer side.
DEFAULT_RADIUS_SHARE = 0.25


@dataclass(frozen=True)
class PoseWindows:
    """Reference and input at their nominal places, with pixels of one size, north up.

    Images without georeferencing are assumed to have pixels of one size and a common centre.

    Parameters
    ----------
    reference, input
        The windows; their centres coincide.
    reference_grid, input_grid
        Grids of their pixels on the reference's map.
    nominal
        Reference map position → input pixel position, by the georeferencing.
    radius_m
        Largest displacement of the input.
    """

    reference: Patch
    input: Patch
    reference_grid: Grid
    input_grid: Grid
    nominal: Transform
    radius_m: float

    @property
    def pixel_m(self) -> float:
        """Side of the pixels, in metres (in pixels of the images without georeferencing)."""
        return self.reference_grid.pixel_size_m

    @property
    def is_georeferenced(self) -> bool:
        """Whether the images are georeferenced."""
        return self.nominal.input_grid.is_georeferenced

    def limits(self, rotation_deg: float, scale: tuple[float, float]) -> SearchLimits:
        """Return the limits of a search in these windows, in window pixels."""
        return SearchLimits(self.radius_m / self.pixel_m, rotation_deg, scale)

    def transform(self, pose: Pose) -> Transform:
        """Return the transform between the rasters that follows from a pose of the windows."""
        shapes = [(grid.height, grid.width) for grid in (self.reference_grid, self.input_grid)]
        moved = apply_affine(pose.between(shapes[0], shapes[1]), self.reference_grid.outline(4))
        xy = self.reference_grid.pixel_to_map(self.reference_grid.outline(4))
        model = fit_model("affine", xy, self.nominal.model(self.input_grid.pixel_to_map(moved)))
        return Transform(model, self.nominal.crs, self.nominal.input_grid)

    def pose(self, transform: Transform) -> Pose:
        """Return the pose that is nearest to a transform between the rasters."""
        own, other = self.reference_grid.centre_px, self.input_grid.centre_px
        outline = self.reference_grid.outline(4)
        input_px = transform(self.reference_grid.pixel_to_map(outline))
        nominal_xy = self.input_grid.to_own_map(self.nominal.inverse(input_px), self.nominal.crs)
        moved = self.input_grid.map_to_pixel(nominal_xy)
        # Rotation and scale of positions (right, down) are one complex factor.
        start, end = ((px - centre) @ (1, 1j) for px, centre in ((outline, own), (moved, other)))
        design = np.column_stack([start, np.ones(len(start))])
        factor, shift = np.linalg.lstsq(design, end, rcond=None)[0]
        rotation = -float(np.degrees(np.angle(factor)))
        return Pose(rotation, float(abs(factor)), (float(shift.real), float(shift.imag)))


def read_windows(
    reference: Image,
    input: Image,
    scale: tuple[float, float],
    radius_m: float | None = None,
    held_out: MaskOf | None = None,
) -> PoseWindows:
    """Read the parts of two images that may show common ground.

    Parameters
    ----------
    reference, input
        The images.
    scale
        Smallest and largest scale that will be searched for.
    radius_m
        Largest distance of the input from its nominal place; None: a quarter of its longer side.
    held_out
        Returns the pixels of the reference in a piece of the grid that take no part; None: all
        pixels take part.

    Raises
    ------
    GeoreferencingError
        Only one of the images is georeferenced.
    NoOverlapError
        The images do not show common ground.
    RasterContentError
        One of the images is constant or has no valid pixel, maybe because of its mask.
    """
    nominal = _nominal(reference, input)
    own = reference.source.grid
    frame = _metric_frame(own)
    low, high = _box(frame, own.pixel_to_map(own.outline()))
    outline = own.to_own_map(nominal.inverse(nominal.input_grid.outline()), nominal.crs)
    if not np.isfinite(outline).all():
        raise NoOverlapError(_apart(reference, input))
    nominal_low, nominal_high = _box(frame, outline)
    side = float((nominal_high - nominal_low).max())
    radius = DEFAULT_RADIUS_SHARE * side if radius_m is None else radius_m
    # The input, at any rotation, covers no more of the reference than this.
    reach = float(np.hypot(*(nominal_high - nominal_low))) / 2 / scale[0] + radius
    middle = (nominal_low + nominal_high) / 2
    low, high = np.maximum(low, middle - reach), np.minimum(high, middle + reach)
    if (high <= low).any() or ((nominal_low > high + radius) | (nominal_high < low - radius)).any():
        raise NoOverlapError(_apart(reference, input))
    centre, half = (low + high) / 2, (high - low) / 2
    needed = float(np.hypot(*half)) * scale[1] + radius
    around = np.minimum(np.maximum(nominal_high - centre, centre - nominal_low), needed)
    longest = 2 * max(half.max(), around.max() / np.sqrt(scale[0] * scale[1]))
    pixel = max(own.pixel_size_m, nominal.input_grid.pixel_size_m, longest / LONGEST_PX)
    first, second = (_grid(frame, own, centre, size, pixel) for size in (half, around))
    # Both windows grow by incomplete pixels on all sides, so that their centres still coincide.
    hidden = None if held_out is None else held_out(first)
    of_reference, of_input = (first, own.map_to_pixel, hidden), (second, nominal)
    patches = reference.read_onto(*of_reference), input.read_onto(*of_input)
    where = "where the images are compared"
    require_content(reference, patches[0], where, *of_reference)
    require_content(input, patches[1], where, *of_input)
    return PoseWindows(*patches, first, second, nominal, radius)


def _nominal(reference: Image, input: Image) -> Transform:
    ref, inp = reference.source, input.source
    require_georeferenced_alike(ref, inp)
    if ref.grid.is_georeferenced:
        return Transform.nominal(ref.grid.crs, inp.grid)
    apart = np.subtract(inp.grid.centre_px, ref.grid.centre_px)
    return Transform(shift_model(*apart.tolist()), None, inp.grid)


def _metric_frame(grid: Grid) -> Affine:
    """Return the transform from metres right of and below a grid's centre to its map."""
    x, y = grid.pixel_to_map([grid.centre_px])[0]
    across, along = grid.metres_per_unit
    down = -1 if grid.is_georeferenced else 1
    return Affine(1 / across, 0, x, 0, down / along, y)


def _box(frame: Affine, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper limits of map positions, in metres (right, down)."""
    metres = apply_affine(~frame, xy)
    return metres.min(axis=0), metres.max(axis=0)


def _grid(frame: Affine, like: Grid, centre: FloatArray, half: FloatArray, pixel: float) -> Grid:
    """Return the grid of square pixels that covers a box, given by its centre and half its size."""
    width, height = np.maximum(np.ceil(2 * half / pixel - 1e-6), 1).astype(int)
    left, top = centre - np.array([width, height]) * pixel / 2
    corner = compose(frame, Affine.translation(left, top), Affine.scale(pixel))
    return like.on_same_map(corner, int(width), int(height))


def _apart(reference: Image, input: Image) -> str:
    return f"{reference.source.path} and {input.source.path} do not overlap"
