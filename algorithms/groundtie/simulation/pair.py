"""A SAR and an optical image of the same simulated ground, and the true mapping between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from affine import Affine
from rasterio.crs import CRS

from ..arrays import Raster
from ..errors import ParameterError
from ..geometry.models import TERRAIN, PolynomialModel
from ..geometry.terrain import Terrain
from ..geometry.terrain_model import TerrainModel
from ..geometry.transform import Transform
from ..progress import SILENT, Progress
from ..rasters.grid import LON_LAT, Grid, reproject
from .check_points import InputImage, RoofPoints, ground_points, roof_points
from .held import PAIR_BYTES, require_memory
from .misregistration import (
    DistortionOptions,
    Positions,
    draw_misregistration,
    needed_margin,
    resample,
)
from .noise import SmoothNoise, Stream, random_stream
from .optical import OpticalOptions, blur, direction, quantise, render_radiance
from .sar import SarOptions, add_speckle, quantise_amplitude, render_sar, sar_power
from .scene import Scene, SceneOptions, generate_scenes

OPTICAL, SAR = "optical", "sar"
INPUTS = (OPTICAL, SAR)

# On the central meridian, where azimuths count from the map's north as from true north.
CRS_EPSG = 32633
CORNER_M = (500_000.0, 5_334_000.0)

_MARGIN_STEP_PX = 64

# Half the wavelength of the terrain error, and its largest value in standard deviations.
_ERROR_CELL_PX = 100
_ERROR_REACH = 4


@dataclass(frozen=True)
class PairOptions:
    """All options of a simulated pair.

    Attributes
    ----------
    scene, sar, optical, distortion
        Options of the parts.
    input_pixel_size_m : float or None
        Pixel size of the input; None for that of the scene.
    input : str
        The image that is the input, one of `INPUTS`; the other one is the reference.
    terrain_error_m : float
        Standard deviation of the error of the heights that the input was orthorectified with; the
        error is correlated over some 100 pixels.
    """

    scene: SceneOptions = field(default_factory=SceneOptions)
    sar: SarOptions = field(default_factory=SarOptions)
    optical: OpticalOptions = field(default_factory=OpticalOptions)
    distortion: DistortionOptions = field(default_factory=DistortionOptions)
    input_pixel_size_m: float | None = None
    input: str = OPTICAL
    terrain_error_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse options that cannot be simulated."""
        if self.input not in INPUTS:
            raise ParameterError(f"input must be one of {', '.join(INPUTS)}, not {self.input!r}")
        if self.terrain_error_m < 0:
            raise ParameterError("terrain_error_m must not be negative")
        if self.terrain_error_m and self.distortion.kind == "polynomial":
            raise ParameterError("an error of the terrain goes with any distortion but polynomial")
        if not 0.25 <= self.pixel_ratio <= (16 if self.input == OPTICAL else 1):
            raise ParameterError(
                "input_pixel_size_m must be 0.25 to 16 times the scene's pixel size; no larger "
                "than that if the input is the SAR image"
            )

    @property
    def sight(self) -> tuple[float, float]:
        """Relief displacement (east, north) in the input, in metres per metre of height."""
        if self.input == SAR:
            return self.sar.towards_radar * self.sar.cot_incidence, 0.0
        east, south = direction(self.optical.view_azimuth_deg)
        return -east * self.optical.lean, south * self.optical.lean

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
        Options of the simulation.
    reference : uint16 array (bands, rows, columns)
        Geocoded SAR amplitude, or an 11-bit optical image.
    reference_grid : Grid
        Georeferencing of the reference.
    input : uint16 array (bands, rows, columns)
        The other image.
    truth : Transform
        Reference map position -> input pixel (col, row), exact for points on the ground;
        `truth.input_grid` is the nominal georeferencing of the input.
    check_points_px : float64 array (n, 2)
        Reference pixels (col, row) on open ground that the input shows.
    roof_points : RoofPoints
        Points on roofs, which both images show displaced from the ground below.
    scene : Scene
        The scene, with its margin, at the radar's acquisition.
    assumed_m : float32 array (rows, columns)
        Heights, with the same margin, that the input was orthorectified with.
    """

    options: PairOptions
    reference: npt.NDArray[np.uint16]
    reference_grid: Grid
    input: npt.NDArray[np.uint16]
    truth: Transform
    check_points_px: npt.NDArray[np.float64]
    roof_points: RoofPoints
    scene: Scene
    assumed_m: npt.NDArray[np.float32]


def simulate_pair(options: PairOptions, progress: Progress = SILENT) -> SimulatedPair:
    """Simulate a pair; the same options give the same pair.

    Raises
    ------
    ParameterError
        The options are not compatible.
    MemoryLimitError
        The scene needs more memory than the budget.
    CancelledError
        The user cancelled the work.
    """
    scene_options = options.scene
    reference_grid = map_grid(scene_options)
    nominal = reference_grid.scaled(options.pixel_ratio)
    model = draw_misregistration(options.distortion, nominal, scene_options.seed)
    progress.update(0.0, "laying out the scene")
    reach = object_reach_px(scene_options, options.sar, options.optical) + _error_reach_px(options)
    margin = in_steps(needed_margin(model, reference_grid, nominal) + reach)
    around = reference_grid.widened(margin)
    require_memory(around, nominal, PAIR_BYTES)
    scenes = generate_scenes(scene_options, margin)
    assumed_m = _assumed_terrain(scenes.radar, options)
    truth = Transform(model, reference_grid.crs, nominal)
    positions = Positions.interpolated(truth, around)
    if options.terrain_error_m:
        displaced = _displaced(model, scenes.radar.terrain_m, assumed_m, around, options)
        truth = Transform(displaced, reference_grid.crs, nominal)
        positions = Positions.exact(truth, around)
    progress.update(0.25, "looking with the radar")
    is_radar = options.input == SAR
    radar = _radar_image(scenes.radar, options, positions if is_radar else None)
    progress.update(0.4, "looking with the camera")
    camera = camera_image(
        scenes.camera,
        options.optical,
        None if is_radar else positions,
        1.0 if is_radar else options.pixel_ratio,
        progress,
    )
    image = InputImage(lambda px: truth(reference_grid.pixel_to_map(px)), nominal)
    return SimulatedPair(
        options=options,
        reference=camera if is_radar else radar,
        reference_grid=reference_grid,
        input=radar if is_radar else camera,
        truth=truth,
        check_points_px=ground_points(scenes, reference_grid, image),
        roof_points=roof_points(
            scenes, reference_grid, image, options.sar, options.optical, is_radar
        ),
        scene=scenes.radar,
        assumed_m=assumed_m,
    )


def _radar_image(
    scene: Scene, options: PairOptions, positions: Positions | None
) -> npt.NDArray[np.uint16]:
    """Return the radar image, (1, rows, columns); resampled at the positions unless None."""
    if positions is None:
        return render_sar(scene, options.sar)[None]
    power = sar_power(replace(scene, margin_px=0), options.sar)
    seen = np.maximum(resample(power, positions), power.min())
    speckle = random_stream(options.scene.seed, Stream.SPECKLE)
    return quantise_amplitude(add_speckle(seen, options.sar.looks, speckle), options.sar)[None]


def camera_image(
    scene: Scene,
    options: OpticalOptions,
    positions: Positions | None,
    pixel_ratio: float,
    progress: Progress,
) -> npt.NDArray[np.uint16]:
    """Return the camera image, (bands, rows, columns).

    Parameters
    ----------
    scene
        The scene at the camera's acquisition.
    options
        Options of the camera.
    positions
        Positions of the image's pixels in the scene; None: the scene's pixels without the margin.
    pixel_ratio
        Size of the image's pixels over that of the scene's pixels.
    progress
        Receives every band.
    """
    radiance = render_radiance(scene, options)
    rows, columns = scene.window
    image = []
    for band, light in enumerate(radiance):
        progress.update(0.5 + 0.5 * band / len(radiance), "resampling the optical image")
        # Below 0.6 px, the image would be too sharp for cubic interpolation.
        blur(light, max(options.psf_sigma_px * pixel_ratio, 0.6))
        seen = light[rows, columns] if positions is None else resample(light, positions)
        noise = random_stream(scene.seed, Stream.OPTICAL_NOISE, band)
        image.append(quantise(seen, options, noise))
    return np.stack(image)


def _assumed_terrain(scene: Scene, options: PairOptions) -> npt.NDArray[np.float32]:
    """Return the heights, on the scene's pixels, that the input was orthorectified with."""
    if not options.terrain_error_m:
        return scene.terrain_m
    rows, columns = scene.terrain_m.shape
    generator = random_stream(options.scene.seed, Stream.TERRAIN_ERROR)
    error = SmoothNoise.draw((rows, columns), _ERROR_CELL_PX, generator).rows(0, rows)
    return scene.terrain_m + error * np.float32(options.terrain_error_m)


def _displaced(
    model: PolynomialModel,
    ground_m: npt.NDArray[np.float32],
    assumed_m: npt.NDArray[np.float32],
    grid: Grid,
    options: PairOptions,
) -> TerrainModel:
    """Return a misregistration that includes the displacement by the terrain error."""
    ground, assumed = (Raster(m, grid.transform, grid.crs) for m in (ground_m, assumed_m))
    (left, top), (right, bottom) = grid.pixel_to_map([[0, 0], [grid.width - 1, grid.height - 1]])
    terrain = Terrain.open(ground, assumed, grid.crs, (left, bottom, right, top))
    coefficients = np.zeros((4, 2))
    coefficients[: len(model.coefficients)] = model.coefficients
    coefficients[3] = np.array(options.sight) / model.frame.to_map.a
    return TerrainModel(TERRAIN, model.frame, coefficients, terrain, 0.0)


def _error_reach_px(options: PairOptions) -> int:
    """Return the largest displacement of the input by the terrain error."""
    metres = _ERROR_REACH * options.terrain_error_m * math.hypot(*options.sight)
    return math.ceil(metres / options.scene.pixel_size_m)


def map_grid(options: SceneOptions) -> Grid:
    """Return the grid of the reference image of a scene.

    Raises
    ------
    ParameterError
        The scene is larger than the extent of its map projection.
    """
    px_m = options.pixel_size_m
    transform = Affine(px_m, 0, CORNER_M[0], 0, -px_m, CORNER_M[1])
    grid = Grid(transform, CRS.from_epsg(CRS_EPSG), *options.size_px)
    outline = grid.pixel_to_map(grid.outline())
    back = reproject(reproject(outline, grid.crs, LON_LAT), LON_LAT, grid.crs)
    # The comparison is also false for values that are not finite.
    if not (np.abs(back - outline) < px_m).all():
        raise ParameterError(
            f"a scene of {grid.width} × {grid.height} px of {px_m:g} m is larger than its map: "
            "take smaller pixels, or fewer"
        )
    return grid


def object_reach_px(scene: SceneOptions, sar: SarOptions, optical: OpticalOptions) -> int:
    """Return the largest distance from its foot at which either image can show an object or hill.

    Cast shadows count, too.
    """
    object_m = scene.highest_object_m
    cot = sar.cot_incidence
    radar_m = (object_m + scene.relief_m) * cot + object_m / cot
    camera_m = object_m * (optical.lean + optical.shadow)
    return math.ceil(max(radar_m, camera_m) / scene.pixel_size_m)


def in_steps(margin_px: int) -> int:
    """Return a margin rounded up to a coarse step.

    The scene depends on its outer size. With coarse steps it stays the same under small changes of
    the distortion or the viewing geometry.
    """
    return math.ceil(margin_px / _MARGIN_STEP_PX) * _MARGIN_STEP_PX
