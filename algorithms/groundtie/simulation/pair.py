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
from .check_points import OpticalImage, RoofPoints, Scenes, ground_points, roof_points
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
from .scene import Scene, SceneOptions, generate_scenes

CRS_EPSG = 32633
CORNER_M = (412_000.0, 5_334_000.0)

_MARGIN_STEP_PX = 64


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
        `truth.input_grid` is the nominal georeferencing of the input.
    check_points_px : float64 array (n, 2)
        Reference pixels (col, row) on open ground that the input shows.
    roof_points : RoofPoints
        Points on roofs, which the two images show elsewhere than the ground below them.
    scene : Scene
        The country, with its margin, when the radar took its image.
    """

    options: PairOptions
    reference: npt.NDArray[np.uint16]
    reference_grid: Grid
    input: npt.NDArray[np.uint16]
    truth: Transform
    check_points_px: npt.NDArray[np.float64]
    roof_points: RoofPoints
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
    reference_grid = map_grid(scene_options)
    nominal = reference_grid.scaled(options.pixel_ratio)
    model = draw_misregistration(options.distortion, nominal, scene_options.seed)
    truth = Transform(model, reference_grid.crs, nominal)
    progress.update(0.0, "laying out the scene")
    reach = object_reach_px(scene_options, options.sar, options.optical)
    margin = in_steps(needed_margin(model, reference_grid, nominal) + reach)
    scenes = Scenes(*generate_scenes(scene_options, margin))
    progress.update(0.25, "looking with the radar")
    reference = render_sar(scenes.radar, options.sar)
    progress.update(0.4, "looking with the camera")
    radiance = render_radiance(scenes.camera, options.optical)
    positions = SourcePositions.of(truth, scene_grid(reference_grid, margin))
    image = np.empty((len(radiance), nominal.height, nominal.width), np.uint16)
    for band, light in enumerate(radiance):
        progress.update(0.5 + 0.5 * band / len(radiance), "resampling the optical image")
        # Below 0.6 px the cubic kernel could not follow the scene any more.
        blur(light, max(options.optical.psf_sigma_px * options.pixel_ratio, 0.6))
        seen = resample(light, positions, nominal.height)
        noise = random_stream(scene_options.seed, Stream.OPTICAL_NOISE, band)
        image[band] = quantise(seen, options.optical, noise)
    optical = OpticalImage(lambda px: truth(reference_grid.pixel_to_map(px)), nominal)
    return SimulatedPair(
        options=options,
        reference=reference,
        reference_grid=reference_grid,
        input=image,
        truth=truth,
        check_points_px=ground_points(scenes, reference_grid, optical),
        roof_points=roof_points(scenes, reference_grid, optical, options.sar, options.optical),
        scene=scenes.radar,
    )


def map_grid(options: SceneOptions) -> Grid:
    """Return the grid of the SAR image of a scene."""
    px_m = options.pixel_size_m
    transform = Affine(px_m, 0, CORNER_M[0], 0, -px_m, CORNER_M[1])
    return Grid(transform, CRS.from_epsg(CRS_EPSG), *options.size_px)


def scene_grid(grid: Grid, margin_px: int) -> Grid:
    """Return the grid of a scene that goes on beyond the grid of its SAR image."""
    around = 2 * margin_px
    return grid.window(-margin_px, -margin_px, grid.width + around, grid.height + around)


def object_reach_px(scene: SceneOptions, sar: SarOptions, optical: OpticalOptions) -> int:
    """Return how far from its foot an object or a hill can show up in either image."""
    object_m = scene.highest_object_m
    cot = sar.cot_incidence
    radar_m = (object_m + scene.relief_m) * cot + object_m / cot
    camera_m = object_m * (optical.lean + optical.shadow)
    return math.ceil(max(radar_m, camera_m) / scene.pixel_size_m)


def in_steps(margin_px: int) -> int:
    """Return a margin that is at least as wide.

    The scene depends on its outer size: in coarse steps, it stays the same when only the
    distortion or the look changes somewhat.
    """
    return math.ceil(margin_px / _MARGIN_STEP_PX) * _MARGIN_STEP_PX
