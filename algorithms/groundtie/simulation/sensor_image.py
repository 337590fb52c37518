"""An optical image in sensor geometry, with RPCs, and a SAR image of the same ground."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from ..errors import ParameterError
from ..progress import SILENT, Progress
from ..rasters.grid import LON_LAT, FloatArray, Grid, mesh, reproject
from ..sensor.rpc import image_places
from ..sensor.rpc_fit import HEIGHTS, RPCFit, fit_rpc
from .attitude import AttitudeError, AttitudeOptions
from .camera import PushBroom
from .check_points import InputImage, RoofPoints, ground_points, roof_points
from .held import SENSOR_BYTES, require_memory
from .misregistration import Positions
from .noise import strips
from .optical import OpticalOptions
from .pair import camera_image, in_steps, map_grid, object_reach_px
from .sar import SarOptions, render_sar
from .scene import SceneOptions, generate_scenes

# Ellipsoidal height of the scene's height 0.
GROUND_M = 450.0

# Height range in which RPCs are valid, beyond that of the terrain.
_RPC_REACH_M = 200.0

_PRECISION_M = 1e-5
_STEPS = 100


@dataclass(frozen=True)
class SensorOptions:
    """All options of a simulated sensor image.

    Attributes
    ----------
    scene, sar, optical, attitude
        Options of the parts; `optical` gives the viewing direction of the camera.
    heading_deg : float
        Flight direction of the satellite, clockwise from north.
    altitude_m : float
        Height of the satellite above the ground.
    """

    scene: SceneOptions = field(default_factory=SceneOptions)
    sar: SarOptions = field(default_factory=SarOptions)
    optical: OpticalOptions = field(default_factory=OpticalOptions)
    attitude: AttitudeOptions = field(default_factory=AttitudeOptions)
    heading_deg: float = 193.0
    altitude_m: float = 681_000.0

    def __post_init__(self) -> None:
        """Refuse options that cannot be simulated."""
        if self.optical.off_nadir_deg > 45:
            raise ParameterError("the camera must look down by 45° or more steeply")

    @property
    def hills_m(self) -> float:
        """Largest rise or fall of the terrain: one and a half times its usual range."""
        return 1.5 * self.scene.relief_m


@dataclass(frozen=True)
class SensorImage:
    """A simulated sensor image.

    Attributes
    ----------
    options : SensorOptions
        Options of the simulation.
    reference : uint16 array (rows, columns)
        Geocoded SAR amplitude.
    reference_grid : Grid
        Georeferencing of the reference.
    image : uint16 array (bands, rows, columns)
        11-bit optical image in sensor geometry.
    camera : PushBroom
        The true sensor geometry.
    error : AttitudeError
        Error of the delivered RPCs.
    exact, delivered : RPCFit
        RPCs of the camera, without and with the error.
    terrain : Terrain
        The bare ground. It covers all ground that the image shows, by its true and by its delivered
        geometry.
    surface_m : float32 array (rows, columns)
        Heights on the terrain's grid with buildings and trees.
    check_points_px : float64 array (n, 2)
        Reference pixels (col, row) on open ground that the image shows.
    roof_points : RoofPoints
        Points on roofs that both images show.
    """

    options: SensorOptions
    reference: npt.NDArray[np.uint16]
    reference_grid: Grid
    image: npt.NDArray[np.uint16]
    camera: PushBroom
    error: AttitudeError
    exact: RPCFit
    delivered: RPCFit
    terrain: Terrain
    surface_m: npt.NDArray[np.float32]
    check_points_px: FloatArray
    roof_points: RoofPoints

    def ground_m(self, px: FloatArray) -> FloatArray:
        """Return the ground (x, y, height), shape (n, 3), of reference pixels (n, 2)."""
        return self.terrain.under(self.reference_grid.pixel_to_map(px))


@dataclass(frozen=True)
class Terrain:
    """Heights of the ground above the ellipsoid, linear between the pixels of a grid."""

    height_m: npt.NDArray[np.float32]
    grid: Grid

    def at(self, xy: FloatArray) -> FloatArray:
        """Return heights, shape (n,), at map positions (n, 2)."""
        place = self.grid.map_to_pixel(xy)[:, ::-1].T
        return np.asarray(map_coordinates(self.height_m, place, float, order=1, mode="nearest"))

    def under(self, xy: FloatArray) -> FloatArray:
        """Return the ground (x, y, height), shape (n, 3), at map positions (n, 2)."""
        return np.column_stack([xy, self.at(xy)])

    def seen_by(self, camera: PushBroom, px: FloatArray) -> FloatArray:
        """Return the map positions of the ground at image positions, both (n, 2)."""
        height_m = np.full(len(px), GROUND_M)
        for _ in range(_STEPS):
            xy = camera.localise(px, height_m)
            found = self.at(xy)
            change = np.abs(found - height_m).max(initial=0.0)
            height_m = found
            if change < _PRECISION_M:
                break
        return xy


def simulate_sensor_image(options: SensorOptions, progress: Progress = SILENT) -> SensorImage:
    """Simulate a sensor image; the same options give the same image.

    Raises
    ------
    ParameterError
        The options are not compatible.
    MemoryLimitError
        The scene needs more memory than the budget.
    CancelledError
        The user cancelled the work.
    """
    scene_options, view = options.scene, options.optical
    size, pixel_m = scene_options.size_px, scene_options.pixel_size_m
    grid = map_grid(scene_options)
    camera = _camera(options, grid)
    error = AttitudeError.draw(options.attitude, size, pixel_m, scene_options.seed)
    progress.update(0.0, "laying out the scene")
    margin = _margin_px(options, grid, camera, error)
    around = grid.widened(margin)
    require_memory(around, grid, SENSOR_BYTES)
    scenes = generate_scenes(scene_options, margin)
    terrain = Terrain(scenes.radar.terrain_m + np.float32(GROUND_M), around)
    progress.update(0.25, "looking with the radar")
    reference = render_sar(scenes.radar, options.sar)
    progress.update(0.4, "looking with the camera")
    image = camera_image(scenes.camera, view, _seen(camera, terrain, size), 1.0, progress)
    exact, delivered = _rpcs(options, camera, error, grid)
    optical = InputImage(
        lambda px: camera.project(terrain.under(grid.pixel_to_map(px))),
        grid.on_own_pixels(),
    )
    return SensorImage(
        options=options,
        reference=reference,
        reference_grid=grid,
        image=image,
        camera=camera,
        error=error,
        exact=exact,
        delivered=delivered,
        terrain=terrain,
        surface_m=scenes.radar.surface_m + np.float32(GROUND_M),
        check_points_px=ground_points(scenes, grid, optical),
        roof_points=roof_points(scenes, grid, optical, options.sar, view),
    )


def _camera(options: SensorOptions, grid: Grid) -> PushBroom:
    """Return the camera that is aimed at the centre of the scene."""
    x, y = grid.pixel_to_map([grid.centre_px])[0].tolist()
    return PushBroom.aimed(
        (x, y, GROUND_M),
        options.scene.size_px,
        options.scene.pixel_size_m,
        options.optical.view_azimuth_deg,
        options.optical.off_nadir_deg,
        options.heading_deg,
        options.altitude_m,
    )


def _margin_px(options: SensorOptions, grid: Grid, camera: PushBroom, error: AttitudeError) -> int:
    """Return the margin of the scene beyond the SAR image.

    The scene covers all ground that the image shows, by its true geometry and by its RPCs.
    """
    outline = grid.outline()
    seen = [
        grid.map_to_pixel(camera.localise(px, GROUND_M + height_m))
        for px in (outline, error.inverse()(outline))
        for height_m in (-options.hills_m, options.hills_m)
    ]
    px = np.concatenate(seen)
    beyond = np.maximum(-px, px - [grid.width - 1, grid.height - 1]).max()
    reach = object_reach_px(options.scene, options.sar, options.optical)
    return in_steps(max(math.ceil(float(beyond)), 0) + reach)


def _seen(camera: PushBroom, terrain: Terrain, size: tuple[int, int]) -> Positions:
    """Return the positions in the scene of the ground that the image's pixels show."""
    places = np.empty((2, size[1], size[0]))
    for _, start, stop in strips(size[1]):
        px = mesh(np.arange(size[0]), np.arange(start, stop)).astype(float)
        place = terrain.grid.map_to_pixel(terrain.seen_by(camera, px))
        places[:, start:stop] = place[:, ::-1].T.reshape(2, stop - start, size[0])
    return Positions((size[1], size[0]), lambda start, stop: places[:, start:stop])


def _rpcs(
    options: SensorOptions, camera: PushBroom, error: AttitudeError, grid: Grid
) -> tuple[RPCFit, RPCFit]:
    """Return the RPCs of the camera, without and with the error, over the image's own range."""
    reach_m = options.hills_m + _RPC_REACH_M
    heights_m = np.linspace(GROUND_M - reach_m, GROUND_M + reach_m, HEIGHTS)
    nominal, heights = image_places(options.scene.size_px, heights_m)

    def fitted(px: FloatArray) -> RPCFit:
        lon_lat = reproject(camera.localise(px, heights), grid.crs, LON_LAT)
        if not np.isfinite(lon_lat).all():
            raise ParameterError(
                f"the camera sees ground beyond the map: take pixels of less than "
                f"{options.scene.pixel_size_m:g} m, or fewer"
            )
        return fit_rpc(lon_lat, heights, nominal)

    # RPCs with the error assign other ground positions to the same image pixels.
    return fitted(nominal), fitted(error.inverse()(nominal))
