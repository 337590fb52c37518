"""Misregistrations with exactly known parameters, and the resampling that applies them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import map_coordinates, spline_filter

from ..errors import ParameterError
from ..geometry.models import DEGREE, Frame, Model, PolynomialModel, monomials
from ..geometry.transform import Transform
from ..rasters.grid import Grid, mesh
from ..rasters.reading import FloatImage
from .noise import Stream, random_stream, strips

# Kind of distortion -> kind of model that describes it exactly.
DISTORTIONS = {
    "shift": "translation",
    "rotation": "rigid",
    "scale": "similarity",
    "similarity": "similarity",
    "affine": "affine",
    "polynomial": "polynomial3",
}

_NODE_SPACING_PX = 64
_MIN_NODES = 8
_SPLINE_REACH_PX = 4
# In units of half the longer side.
_LARGEST_WARP = 0.1


@dataclass(frozen=True)
class DistortionOptions:
    """Kind and size of the error of the input's georeferencing.

    Attributes
    ----------
    kind : str
        One of `DISTORTIONS`.
    shift_px : float
        Length of the shift in input pixels; its direction is random.
    rotation_deg : float
        Rotation of the content, counter-clockwise on the map ("rotation" and "similarity").
    scale : float
        Enlargement of the content ("scale" and "similarity").
    warp_px : float
        Largest displacement in addition to the shift, in input pixels ("affine" and "polynomial").
    """

    kind: str = "affine"
    shift_px: float = 8.0
    rotation_deg: float = 2.0
    scale: float = 1.02
    warp_px: float = 4.0

    def __post_init__(self) -> None:
        """Refuse options that cannot be simulated."""
        if self.kind not in DISTORTIONS:
            names = ", ".join(DISTORTIONS)
            raise ParameterError(f"distortion must be one of {names}, not {self.kind!r}")
        if self.shift_px < 0 or self.warp_px < 0 or not 0.1 <= self.scale <= 10:
            raise ParameterError("shift and warp must not be negative, scale must be 0.1 to 10")


def draw_misregistration(options: DistortionOptions, grid: Grid, seed: int) -> PolynomialModel:
    """Draw the nominal positions of the ground in the input.

    Parameters
    ----------
    options : DistortionOptions
        Kind and size of the misregistration.
    grid : Grid
        Nominal georeferencing of the input.
    seed : int
        Seed of the direction of the shift and of the warp.

    Returns
    -------
    PolynomialModel
        Reference map position -> nominal map position; rotations and scales are about the centre.
    """
    generator = random_stream(seed, Stream.DISTORTION)
    frame = Frame.around(grid.pixel_to_map(grid.outline(1)))
    kind = DISTORTIONS[options.kind]
    terms = (DEGREE[kind] + 1) * (DEGREE[kind] + 2) // 2
    # The frame's unit is half the longer side.
    px = 2 / max(grid.size)
    coefficients = np.zeros((terms, 2))
    azimuth = generator.uniform(0, 2 * math.pi)
    coefficients[0] = options.shift_px * px * np.array([math.cos(azimuth), math.sin(azimuth)])
    if kind in ("affine", "polynomial3"):
        # A warp that folds the plane has no inverse; the limit stays far from that.
        if options.warp_px * px > _LARGEST_WARP:
            raise ParameterError(
                "warp must be at most a twentieth of the input's longer side: "
                f"{options.warp_px:g} px are more than {_LARGEST_WARP / px:g} px"
            )
        coefficients[1:] = _drawn_warp(generator, terms - 1, DEGREE[kind], options.warp_px * px)
    elif kind != "translation":
        factor = 1.0 if options.kind == "rotation" else options.scale
        turn = 0.0 if options.kind == "scale" else math.radians(options.rotation_deg)
        cos, sin = factor * math.cos(turn), factor * math.sin(turn)
        coefficients[1:] = [[cos - 1, sin], [-sin, cos - 1]]
    return PolynomialModel(kind, frame, coefficients)


def _drawn_warp(
    generator: np.random.Generator, terms: int, degree: int, largest: float
) -> npt.NDArray[np.float64]:
    """Draw non-constant coefficients with a displacement of at most `largest` in the frame."""
    drawn = generator.uniform(-1, 1, (terms, 2))
    side = np.linspace(-1, 1, 41)
    displacement = monomials(mesh(side, side), degree)[:, 1:] @ drawn
    return drawn * (largest / np.hypot(*displacement.T).max())


def needed_margin(model: Model, reference: Grid, nominal: Grid) -> int:
    """Return the margin, in pixels, that the input's ground needs around the reference image."""
    outline = Transform(model, reference.crs, nominal).inverse(nominal.outline())
    px = reference.map_to_pixel(outline)
    beyond = np.maximum(-px, px - [reference.width - 1, reference.height - 1])
    return max(math.ceil(float(beyond.max())), 0) + _SPLINE_REACH_PX


@dataclass(frozen=True)
class Positions:
    """Positions of an image's pixels on the pixel grid of the scene.

    Attributes
    ----------
    shape : tuple of int
        Rows and columns of the image.
    strip : function
        Maps the first row and the row after the last to the scene (row, column) of the pixels
        between them, shape (2, rows, columns).
    """

    shape: tuple[int, int]
    strip: Callable[[int, int], npt.NDArray[np.float64]]

    @classmethod
    def interpolated(cls, truth: Transform, scene_grid: Grid) -> Positions:
        """Return the positions of all pixels of the truth's input.

        The truth is inverted exactly at nodes. A bicubic spline through them reproduces any affine
        map exactly and gentle polynomials to far below a thousandth of a pixel.
        """
        width, height = truth.input_grid.size
        nodes = _nodes(height), _nodes(width)
        places = _on_scene(truth, scene_grid, *nodes)
        rows, columns = (RectBivariateSpline(*nodes, place) for place in places)

        def strip(start: int, stop: int) -> npt.NDArray[np.float64]:
            row, column = np.arange(start, stop), np.arange(width)
            return np.stack([rows(row, column), columns(row, column)])

        return cls((height, width), strip)

    @classmethod
    def exact(cls, truth: Transform, scene_grid: Grid) -> Positions:
        """Return the same without interpolation, which rough terrain does not permit."""
        width, height = truth.input_grid.size

        def strip(start: int, stop: int) -> npt.NDArray[np.float64]:
            return _on_scene(truth, scene_grid, np.arange(start, stop), np.arange(width))

        return cls((height, width), strip)


def _on_scene(
    truth: Transform, scene_grid: Grid, rows: npt.NDArray[Any], columns: npt.NDArray[Any]
) -> npt.NDArray[np.float64]:
    """Return scene (row, column) of a lattice of input pixels, shape (2, rows, columns)."""
    xy = truth.inverse(mesh(columns, rows))
    px = scene_grid.map_to_pixel(xy).reshape(len(rows), len(columns), 2)
    return np.ascontiguousarray(px.transpose(2, 0, 1)[::-1])


def resample(image: FloatImage, positions: Positions) -> FloatImage:
    """Interpolate an image (rows, columns) of the scene at positions by cubic B-splines."""
    coefficients = spline_filter(image, order=3, output=np.float32, mode="mirror")
    result = np.empty(positions.shape, np.float32)
    for _, start, stop in strips(len(result)):
        map_coordinates(
            coefficients,
            positions.strip(start, stop),
            output=result[start:stop],
            order=3,
            mode="mirror",
            prefilter=False,
        )
    return result


def _nodes(size: int) -> npt.NDArray[np.float64]:
    count = max(math.ceil(size / _NODE_SPACING_PX) + 1, _MIN_NODES)
    return np.linspace(-0.5, size - 0.5, count)
