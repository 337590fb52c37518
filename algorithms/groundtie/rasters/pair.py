"""A reference and an input image on a common matching grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import (
    GeoreferencingError,
    NoOverlapError,
    ParameterError,
    RasterContentError,
    SameFileError,
)
from ..geometry.limits import SearchLimits
from ..geometry.models import Model
from ..geometry.transform import Transform
from .colours import Colours
from .grid import FloatArray, Grid, PointFunction, crs_name, finite
from .patch import Patch, empty_areas
from .raster_masks import kept_on
from .reading import FloatImage, Mask, RasterSource, Window
from .warping import reduction, sample, sample_bands

# The reach of rotated images is determined at angles this far apart.
_ANGLE_STEP_DEG = 5.0

# Fewest bands for classes of colour.
_LEAST_BANDS = 3

# For pairs without a search.
_NOWHERE = SearchLimits(0.0)

# Pixel sizes with a smaller relative difference are equal.
_SAME_SIZE = 0.02


@dataclass(frozen=True)
class Image:
    """One image of a pair: the raster, the band that is matched and a mask.

    Parameters
    ----------
    source
        The raster.
    band
        Number of the band, from 1; None: the mean of all bands.
    mask
        A raster on the same map. Image pixels at which it is 0 or has no data do not take part.
        None: all valid pixels take part.
    mask_span
        Columns and rows of the mask that a matching pixel spans: all must take part for the
        matching pixel to do so (see `masked`).
    mask_note
        Note on the mask for the user.
    mask_hides
        Whether the mask only hides clouds and the like, without information on the ground.
    colours
        Classes of colour to read in place of grey values; None: grey values.
    """

    source: RasterSource
    band: int | None = None
    mask: RasterSource | None = None
    mask_span: tuple[int, int] = (1, 1)
    mask_note: str = ""
    mask_hides: bool = False
    colours: Colours | None = None

    @property
    def has_colours(self) -> bool:
        """Whether classes of colour can be formed: no band was chosen, and there are enough."""
        return self.band is None and len(self.source.image_bands) >= _LEAST_BANDS

    def values_onto(self, grid: Grid, to_px: PointFunction) -> tuple[FloatImage, Mask]:
        """Return grey values, or classes of colour, on a grid, and where they are valid."""
        if self.colours is None:
            return sample(self.source, grid, to_px, "cubic", self.band)
        measured, valid = sample_bands(self.source, grid, to_px, self.colours.measured)
        return self.colours.classes(measured), valid

    def read_onto(self, grid: Grid, to_px: PointFunction, hidden: Mask | None = None) -> Patch:
        """Return the image on a grid; `to_px` takes the grid's map positions to image pixels."""
        values, valid = self.values_onto(grid, to_px)
        shown = None if self.mask is None else self.shown_on(grid, to_px)
        return self.patch(values, valid, shown, hidden)

    def patch(
        self, values: FloatImage, valid: Mask, shown: Mask | None, hidden: Mask | None
    ) -> Patch:
        """Return values of the image as a patch of those that take part.

        Parameters
        ----------
        values, valid
            As from `values_onto`.
        shown
            What the image's mask keeps; None: there is no mask.
        hidden
            Pixels from whose values nothing may be inferred; None: there are none.
        """
        if hidden is not None:
            values, valid = np.where(hidden, np.float32(0), values), valid & ~hidden
        if not self.source.says_what_is_valid:
            valid = valid & ~empty_areas(values, valid)
        if shown is not None:
            valid = valid & shown
        return Patch(values, valid)

    def shown_on(self, grid: Grid, to_px: PointFunction) -> Mask:
        """Return the pixels that the mask, which must exist, keeps; parameters as `read_onto`."""
        assert self.mask is not None
        to_mask = _to_mask_px(self.source, self.mask, to_px)
        return kept_on(self.mask, grid, to_mask, lambda shown: shown != 0, self.mask_span)

    def masked(self, mask: RasterSource, matching: Grid) -> Image:
        """Return the image with a mask, whose pixels may be smaller than matching pixels.

        A matching pixel does not take part if the mask hides any part of it, however narrow. On
        coarser levels, the matching pixel at a pixel's centre decides.
        """
        to_px = matching.to_pixels_of(self.source.grid)
        span = reduction(matching, _to_mask_px(self.source, mask, to_px), mask.grid.size)
        is_so = mask is self.mask and span == self.mask_span
        return self if is_so else replace(self, mask=mask, mask_span=span)

    def bands_onto(self, grid: Grid, to_px: PointFunction) -> FloatImage:
        """Return all bands but alpha on a grid, shape (bands, h, w), 0 where any is invalid."""
        return sample_bands(self.source, grid, to_px)[0]


def require_content(
    image: Image,
    patch: Patch,
    where: str,
    grid: Grid,
    to_px: PointFunction,
    hidden: Mask | None = None,
) -> None:
    """Raise `RasterContentError` if a piece of an image has no content, and say if a mask hides it.

    Parameters
    ----------
    image, patch
        The image, and the piece.
    where
        Name of the piece in messages.
    grid, to_px, hidden
        As `Image.read_onto` read the piece.
    """
    if not patch.is_flat:
        return
    unmasked = patch
    if image.mask is not None:
        unmasked = replace(image, mask=None).read_onto(grid, to_px, hidden)
    name = image.source.path
    if patch.valid.any():
        shown = name if unmasked.is_flat else f"what its mask leaves of {name}"
        raise RasterContentError(f"{shown} is constant {where}")
    if unmasked.valid.any():
        raise RasterContentError(
            f"the mask of {name} leaves nothing of it {where}: it hides all, or lies elsewhere"
        )
    raise RasterContentError(f"{name} has no valid pixel {where}")


def _to_mask_px(source: RasterSource, mask: RasterSource, to_px: PointFunction) -> PointFunction:
    """Return the function from map positions to pixels of a mask, given that to the raster's."""
    to_mask = source.grid.to_pixels_of(mask.grid)
    return lambda xy: to_mask(source.grid.pixel_to_map(to_px(xy)))


@dataclass(frozen=True)
class ImagePair:
    """Reference and input on a common matching grid, read by windows, never as whole scenes.

    Parameters
    ----------
    reference, input
        The two images.
    grid
        The matching grid: the reference's grid, with pixels as large as the coarser image's, over
        the area where the images overlap, or may do so within the search radius.
    overlap_px
        Width and height, in matching pixels, of the bounding box of the nominal overlap.
    surroundings
        The matching grid, extended to all nominal places where either image may show a part of it.
    limits
        Limits of the input's displacement from its nominal place, in metres.
    """

    reference: Image
    input: Image
    grid: Grid
    overlap_px: tuple[int, int]
    surroundings: Grid
    limits: SearchLimits = _NOWHERE

    def reference_patch(self, grid: Grid, hidden: Mask | None = None) -> Patch:
        """Return the reference on a grid in its CRS, masked where `hidden`."""
        return self.reference.read_onto(grid, self.reference.source.grid.map_to_pixel, hidden)

    def input_patch(self, grid: Grid, to_input_px: PointFunction) -> Patch:
        """Return the input on a grid; `to_input_px` takes map positions to input pixels."""
        return self.input.read_onto(grid, to_input_px)

    def exchanged(self) -> ImagePair:
        """Return the pair with the roles of its images exchanged and the same search limits."""
        limits = self.limits
        return make_pair(
            self.input,
            self.reference,
            self.grid.pixel_size_m,
            limits.radius,
            limits.rotation_deg,
            limits.scale[1],
        )

    @property
    def is_masked(self) -> bool:
        """Whether either image has a mask."""
        return self.reference.mask is not None or self.input.mask is not None

    @property
    def is_ground_masked(self) -> bool:
        """Whether a mask may contain information on the ground (see `Image.mask_hides`)."""
        images = (self.reference, self.input)
        return any(image.mask is not None and not image.mask_hides for image in images)

    def notes(self) -> list[str]:
        """Return notes for the user on how the images are read."""
        images = (self.reference, self.input)
        complex_valued = [
            f"{image.source.path} is complex-valued: its amplitude is matched"
            for image in images
            if image.source.is_complex
        ]
        return [*complex_valued, *(image.mask_note for image in images if image.mask_note)]

    def nominal_px(self, xy: FloatArray) -> FloatArray:
        """Return the nominal input pixels of reference map positions, shape (n, 2)."""
        return self.grid.to_pixels_of(self.input.source.grid)(xy)

    def transform(self, model: Model) -> Transform:
        """Return the transform between the images, given the misregistration on the map."""
        return Transform(model, self.grid.crs, self.input.source.grid)


def make_pair(
    reference: Image,
    input: Image,
    matching_pixel_size_m: float | None = None,
    search_radius_m: float | None = None,
    rotation_deg: float = 0.0,
    scale: float = 1.0,
) -> ImagePair:
    """Put two images on a common matching grid.

    Parameters
    ----------
    reference, input
        The two images.
    matching_pixel_size_m
        Pixel size of the matching grid, no less than the finer image's; None: the coarser image's.
    search_radius_m
        Largest distance of the input from its nominal place; None: as `default_radius_m`.
    rotation_deg, scale
        Largest rotation and largest scale, either way, against the input's nominal geotransform.
        If they are searched for without georeferencing, the images' centres are taken to coincide.

    Raises
    ------
    SameFileError
        Both are the same raster.
    ParameterError
        The pixel size is smaller than that of both images, which contain no finer detail.
    GeoreferencingError
        Only one image is georeferenced.
    NoOverlapError
        The images do not overlap, or the input has no position in the reference's CRS.
    """
    ref, inp = reference.source, input.source
    if ref.is_same_as(inp):
        raise SameFileError(f"reference and input are the same raster: {ref.path}")
    require_georeferenced_alike(ref, inp)
    wanted = matching_pixel_size_m or coarser_m(ref.grid, inp.grid)
    own = part_below(ref.grid, inp.grid)
    finest = min(own.pixel_size_m, part_below(inp.grid, ref.grid).pixel_size_m)
    if wanted < finest * (1 - _SAME_SIZE):
        raise ParameterError(
            f"a pixel size for matching of {wanted:g} is finer than both images' ({finest:g})"
        )
    factor = wanted / own.pixel_size_m
    factor = 1.0 if abs(factor - 1) < _SAME_SIZE else factor
    grid, sides_m = ref.grid.scaled(factor), own.scaled(factor).pixel_sides_m
    usual_m = default_radius_m(factor * own.pixel_size_m, ref.grid.crs is not None)
    radius = usual_m if search_radius_m is None else search_radius_m
    limits = SearchLimits(radius, rotation_deg, (1 / scale, scale))
    outline = inp.grid.to_pixels_of(ref.grid)(inp.grid.pixel_to_map(inp.grid.outline()))
    if not len(finite(outline)):
        names = [crs_name(of.grid.crs) for of in (inp, ref) if of.grid.crs is not None]
        raise NoOverlapError(
            f"{inp.path} (in {names[0]}) has no position in the CRS of {ref.path} ({names[1]})"
        )
    nominal = grid.map_to_pixel(ref.grid.pixel_to_map(outline))
    if not limits.is_shift and not ref.grid.is_georeferenced:
        outline = outline + np.subtract(ref.grid.centre_px, inp.grid.centre_px)
    outline = grid.map_to_pixel(ref.grid.pixel_to_map(outline))
    overlap = _box(grid, outline, 0.0)
    if overlap is None:
        raise NoOverlapError(f"{ref.path} and {inp.path} do not overlap")
    if not limits.is_shift:
        outline = _rotated(outline, sides_m, rotation_deg, scale)
    # Measured in the shorter side of a pixel, so that the radius is covered along that axis, too.
    side_m = min(sides_m)
    limits = replace(limits, radius=min(radius, _farthest_px(grid, outline) * side_m))
    radius_px = limits.radius / side_m
    reach = _box(grid, outline, radius_px)
    assert reach is not None
    matching, overlap_px = grid.window(*reach), (overlap.width, overlap.height)
    around = _surroundings(reach, radius_px, None if limits.is_shift else nominal)
    reference, input = (
        image if image.mask is None else image.masked(image.mask, matching)
        for image in (reference, input)
    )
    return ImagePair(reference, input, matching, overlap_px, grid.window(*around), limits)


def require_georeferenced_alike(reference: RasterSource, input: RasterSource) -> None:
    """Raise `GeoreferencingError` if only one of two rasters is georeferenced, or has a CRS."""
    for one, other in ((reference, input), (input, reference)):
        if one.grid.is_georeferenced and not other.grid.is_georeferenced:
            raise GeoreferencingError(f"{other.path} has no georeferencing, but {one.path} has")
        if one.grid.crs is not None and other.grid.crs is None:
            raise GeoreferencingError(f"{other.path} has no CRS, but {one.path} has")


def _farthest_px(grid: Grid, outline_px: FloatArray) -> float:
    """Return the shift beyond which an image with an outline, (n, 2), cannot overlap a grid."""
    low, high = _extent(outline_px)
    return float(np.hypot(*np.maximum(np.array(grid.size) - low, high)))


def _rotated(
    outline_px: FloatArray, sides_m: tuple[float, float], largest_deg: float, largest_scale: float
) -> FloatArray:
    """Return the points of an outline, shape (n, 2), rotated and scaled about its centre.

    Shapes are preserved on the ground: `sides_m` are those of a pixel.
    """
    centre = np.add(*_extent(outline_px)) / 2
    steps = int(np.ceil(2 * largest_deg / _ANGLE_STEP_DEG)) + 1
    angles = np.radians(np.linspace(-largest_deg, largest_deg, steps))
    cosine, sine = np.cos(angles), np.sin(angles)
    rotations = np.array([[cosine, -sine], [sine, cosine]])
    around = largest_scale * (finite(outline_px) - centre) * sides_m
    return np.asarray(centre + np.einsum("ijk,nj->kni", rotations, around).reshape(-1, 2) / sides_m)


def _surroundings(reach: Window, radius_px: float, nominal_px: FloatArray | None) -> Window:
    """Return the nominal places at which an image may show a part of a window.

    An image that may be rotated can show it anywhere in its nominal outline, shape (n, 2).
    """
    low = np.array(reach[:2]) - int(np.ceil(radius_px))
    high = np.array(reach[:2]) + reach[2:] + int(np.ceil(radius_px))
    if nominal_px is not None:
        first, last = _extent(nominal_px)
        low = np.minimum(low, np.floor(first).astype(int))
        high = np.maximum(high, np.ceil(last).astype(int) + 1)
    return Window.between(low, high)


def default_radius_m(pixel_size_m: float, is_on_map: bool) -> float:
    """Return the search radius for matching pixels: 20 of them; on a map 100 m at least."""
    return max(100.0 if is_on_map else 0.0, 20 * pixel_size_m)


def coarser_m(reference: Grid, input: Grid) -> float:
    """Return the pixel size of the coarser of two grids where they overlap, in metres."""
    own_m = part_below(reference, input).pixel_size_m
    return (
        max(own_m, part_below(input, reference).pixel_size_m) if input.is_georeferenced else own_m
    )


def part_below(grid: Grid, other: Grid) -> Grid:
    """Return the part of a grid that another one nominally covers; all of it if none is known.

    The scale of a map of the world is another one at the map's centre.
    """
    window = window_below(grid, other)
    return grid if window[2:] == grid.size else grid.window(*window)


def window_below(grid: Grid, other: Grid) -> Window:
    """Return the pixels of a grid that another one nominally covers; all if none are known."""
    box = None
    if (grid.crs is None) == (other.crs is None):
        outline = other.to_pixels_of(grid)(other.pixel_to_map(other.outline()))
        box = _box(grid, outline, 0.0) if len(finite(outline)) else None
    return Window(0, 0, *grid.size) if box is None else box


def _box(grid: Grid, outline_px: FloatArray, margin_px: float) -> Window | None:
    """Return the pixels of a grid within the bounding box of an outline and a margin."""
    first, last = _extent(outline_px)
    size = np.array(grid.size)
    low = np.clip(np.ceil(first - margin_px), 0, size).astype(int)
    high = np.clip(np.floor(last + margin_px) + 1, 0, size).astype(int)
    return Window.between(low, high) if (high > low).all() else None


def _extent(px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest column and row of the finite positions."""
    px = finite(px)
    return px.min(axis=0), px.max(axis=0)
