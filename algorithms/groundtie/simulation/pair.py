"""A SAR image and an optical image of the same simulated place, and the truth between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from affine import Affine
from rasterio.crs import CRS

from ..errors import ParameterError
from ..geometry.transform import Transform
from ..progress import SILENT, Progress
from ..rasters.grid import Grid
from .cover import OPEN_GROUND
from .layout import highest_object_m
from .misregistration import (
    DistortionOptions,
    SourcePositions,
    draw_misregistration,
    needed_margin,
    resample,
)
from .noise import Stream, random_stream
from .optical import OpticalOptions, blur, quantise, render_radiance
from .sar import SarOptions, render_sar
from .scene import Scene, SceneOptions, generate_scene

CRS_EPSG = 32633
CORNER_M = (412_000.0, 5_334_000.0)

# The scene depends on its outer size: in coarse steps, it stays the same when only the distortion
# or the look changes somewhat.
_MARGIN_STEP_PX = 64
_CHECK_POINTS_PER_SIDE = 12
_CHECK_POINT_TRIES = 20


@dataclass(frozen=True)
class PairOptions:
    """Everything that a simulated pair follows from.

    Attributes
    ----------
    scene, sar, optical, distortion
        Options of the parts.
    input_pixel_size_m : float or None
        Pixel size of the optical image; None for that of the scene.
    """

    scene: SceneOptions = field(default_factory=SceneOptions)
    sar: SarOptions = field(default_factory=SarOptions)
    optical: OpticalOptions = field(default_factory=OpticalOptions)
    distortion: DistortionOptions = field(default_factory=DistortionOptions)
    input_pixel_size_m: float | None = None

    @property
    def pixel_ratio(self) -> float:
        """Input pixel size over reference pixel size."""
        return (self.input_pixel_size_m or self.scene.pixel_size_m) / self.scene.pixel_size_m


@dataclass(frozen=True)
class SimulatedPair:
    """A simulated pair.

    Attributes
    ----------
    options : PairOptions
        What it was made from.
    reference : uint16 array (rows, columns)
        SAR amplitude, geocoded.
    reference_grid : Grid
        Where it lies.
    input : uint16 array (bands, rows, columns)
        Optical image, 11 bit.
    truth : Transform
        Reference map position -> input pixel (col, row), exact for points on the ground;
        `truth.input_grid` is the georeferencing that the input claims.
    check_points_px : float64 array (n, 2)
        Reference pixels (col, row) on open ground that the input shows.
    scene : Scene
        The country, with its margin.
    """

    options: PairOptions
    reference: npt.NDArray[np.uint16]
    reference_grid: Grid
    input: npt.NDArray[np.uint16]
    truth: Transform
    check_points_px: npt.NDArray[np.float64]
    scene: Scene


def simulate_pair(options: PairOptions, progress: Progress = SILENT) -> SimulatedPair:
    """Simulate a pair; the same options give the same pair.

    Raises
    ------
    ParameterError
        The pixel sizes do not go together.
    CancelledError
        The user cancelled the work.
    """
    if not 0.25 <= options.pixel_ratio <= 16:
        raise ParameterError("input_pixel_size_m must be 0.25 to 16 times the scene's pixel size")
    scene_options = options.scene
    width, height = scene_options.size_px
    px_m = scene_options.pixel_size_m
    transform = Affine(px_m, 0, CORNER_M[0], 0, -px_m, CORNER_M[1])
    reference_grid = Grid(transform, CRS.from_epsg(CRS_EPSG), width, height)
    claimed = reference_grid.scaled(options.pixel_ratio)
    model = draw_misregistration(options.distortion, claimed, scene_options.seed)
    truth = Transform(model, reference_grid.crs, claimed)
    progress.update(0.0, "laying out the scene")
    needed = needed_margin(model, reference_grid, claimed) + _object_reach_px(options)
    margin = math.ceil(needed / _MARGIN_STEP_PX) * _MARGIN_STEP_PX
    scene = generate_scene(scene_options, margin)
    progress.update(0.25, "looking with the radar")
    reference = render_sar(scene, options.sar)
    progress.update(0.4, "looking with the camera")
    radiance = render_radiance(scene, options.optical)
    scene_grid = reference_grid.window(-margin, -margin, width + 2 * margin, height + 2 * margin)
    positions = SourcePositions.of(truth, scene_grid)
    image = np.empty((len(radiance), claimed.height, claimed.width), np.uint16)
    for band, light in enumerate(radiance):
        progress.update(0.5 + 0.5 * band / len(radiance), "resampling the optical image")
        # Below 0.6 px the cubic kernel could not follow the scene any more.
        blur(light, max(options.optical.psf_sigma_px * options.pixel_ratio, 0.6))
        seen = resample(light, positions, claimed.height)
        noise = random_stream(scene.seed, Stream.OPTICAL_NOISE, band)
        image[band] = quantise(seen, options.optical, noise)
    return SimulatedPair(
        options=options,
        reference=reference,
        reference_grid=reference_grid,
        input=image,
        truth=truth,
        check_points_px=_check_points(scene, reference_grid, truth),
        scene=scene,
    )


def _object_reach_px(options: PairOptions) -> int:
    """How far from its foot an object or a hill can show up in either image."""
    object_m = highest_object_m(options.scene.density)
    cot = options.sar.cot_incidence
    radar_m = (object_m + options.scene.relief_m) * cot + object_m / cot
    camera_m = object_m * (options.optical.lean + options.optical.shadow)
    return math.ceil(max(radar_m, camera_m) / options.scene.pixel_size_m)


def _check_points(scene: Scene, grid: Grid, truth: Transform) -> npt.NDArray[np.float64]:
    """One point on open ground in each cell of a lattice, where there is one."""
    generator = random_stream(scene.seed, Stream.CHECK_POINTS)
    side = np.arange(_CHECK_POINTS_PER_SIDE)
    cell = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 1, 2)
    drawn = generator.random((len(cell), _CHECK_POINT_TRIES, 2))
    px = (cell + drawn) / _CHECK_POINTS_PER_SIDE * [grid.width - 1, grid.height - 1]
    column, row = np.rint(px).astype(np.intp).transpose(2, 0, 1) + scene.margin_px
    open_ground = np.isin(scene.parcels.cover[scene.parcel[row, column]], OPEN_GROUND)
    open_ground &= scene.object_m[row, column] == 0
    shown = truth.input_grid.contains(truth(grid.pixel_to_map(px.reshape(-1, 2))))
    usable = open_ground & shown.reshape(open_ground.shape)
    first = usable.argmax(axis=1)
    has_one = usable.any(axis=1)
    return np.asarray(px[np.nonzero(has_one)[0], first[has_one]])
