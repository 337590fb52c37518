"""Simulate a SAR–optical pair whose misregistration is known exactly."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from ..declaration import tool
from ..errors import ParameterError
from ..kinds import Choice, Distance, FolderOut, Number
from ..progress import SILENT, Progress
from ..simulation.files import write_pair
from ..simulation.misregistration import DISTORTIONS, DistortionOptions
from ..simulation.optical import OpticalOptions
from ..simulation.pair import INPUTS, OPTICAL, PairOptions, simulate_pair
from ..simulation.sar import SarOptions
from ..simulation.scene import SceneOptions
from .parameters import general, simulated
from .results import SimulatedScene

# Values by default, and the distortions that have them. A warp is at most a twentieth of the side.
_USUAL = {"rotation": 2.0, "scale": 1.02, "warp": 4.0}
_OF_DISTORTIONS = {
    "rotation": ("rotation", "similarity"),
    "scale": ("scale", "similarity"),
    "warp": ("affine", "polynomial"),
}


@tool(title="Simulate a SAR–optical pair", group="Simulation")
def simulate(
    folder: Annotated[
        Path,
        FolderOut(
            help="Gets reference.tif (SAR), input.tif (optical), dem.tif, dsm.tif, "
            "reference.json and input.json (view angles), truth.json, check_points.csv and "
            "roof_points.csv; input_dem.tif where the terrain has an error.",
            shows=("input.tif", "reference.tif"),
        ),
    ],
    size: simulated.Size = 1000,
    density: simulated.Density = "suburban",
    distortion: Annotated[
        str,
        Choice(
            help="What is wrong with the georeferencing of the optical image, besides its shift.",
            choices=tuple(DISTORTIONS),
        ),
    ] = "affine",
    shift: Annotated[
        float,
        Number(
            help="How far the optical image is off; the direction is drawn.",
            unit="px",
            minimum=0,
            maximum=2000,
        ),
    ] = 8.0,
    looks: simulated.Looks = 1.0,
    changed: simulated.Changed = 0.0,
    seed: general.Seed = 0,
    pixel_size: simulated.PixelSize = 1.0,
    input_pixel_size: Annotated[
        float | None,
        Distance(
            label="Pixel size of the input",
            help="Pixel size of the optical image; by default that of the SAR image.",
            minimum=0.1,
            advanced=True,
        ),
    ] = None,
    relief: Annotated[
        float,
        Distance(help="Range of the terrain's heights.", advanced=True),
    ] = 20.0,
    slope: Annotated[
        float | None,
        Number(
            label="Steepest slopes",
            help="Slope that one place in a thousand exceeds, of mountains that are rough at all "
            "scales; by default, country is gentle.",
            unit="°",
            minimum=1,
            maximum=60,
            advanced=True,
        ),
    ] = None,
    terrain_error: Annotated[
        float,
        Distance(
            label="Error of the terrain",
            help="Standard deviation of the error, correlated over some 100 pixels, of the "
            "heights that the input was orthorectified with.",
            advanced=True,
        ),
    ] = 0.0,
    input: Annotated[
        str,
        Choice(
            help="Which image has the wrong georeferencing; the other one is the reference.",
            choices=INPUTS,
            advanced=True,
        ),
    ] = OPTICAL,
    incidence: simulated.Incidence = 35.0,
    orbit: simulated.Orbit = "ascending",
    off_nadir: simulated.OffNadir = 12.0,
    view_azimuth: simulated.ViewAzimuth = 250.0,
    rotation: Annotated[
        float | None,
        Number(
            help="Rotation of the optical image, for distortions rotation and similarity; by "
            "default 2°.",
            unit="°",
            minimum=-30,
            maximum=30,
            advanced=True,
        ),
    ] = None,
    scale: Annotated[
        float | None,
        Number(
            help="Scale of the optical image, for distortions scale and similarity; by default "
            "1.02.",
            minimum=0.8,
            maximum=1.25,
            advanced=True,
        ),
    ] = None,
    warp: Annotated[
        float | None,
        Number(
            help="Largest displacement besides the shift, for distortions affine and polynomial; "
            "by default 4 px, less in images below 80 px.",
            unit="px",
            minimum=0,
            maximum=50,
            advanced=True,
        ),
    ] = None,
    progress: Progress = SILENT,
) -> SimulatedScene:
    """Simulate a SAR–optical pair whose misregistration is known exactly.

    The scene has terrain, fields, roads, water and buildings. The SAR image has layover, shadow,
    double bounce and speckle; the optical one relief displacement, cast shadows and noise. The
    input may be orthorectified with wrong heights. The same seed gives the same pair. The file
    truth.json is a transform like those of `coregister`.
    """
    side_px = int(size * pixel_size / (input_pixel_size or pixel_size))
    options = PairOptions(
        scene=SceneOptions((size, size), pixel_size, density, relief, seed, changed / 100, slope),
        sar=SarOptions(incidence_deg=incidence, orbit=orbit, looks=looks),
        optical=OpticalOptions(view_azimuth_deg=view_azimuth, off_nadir_deg=off_nadir),
        distortion=_distortion(
            distortion, shift, {"rotation": rotation, "scale": scale, "warp": warp}, side_px
        ),
        input_pixel_size_m=input_pixel_size,
        input=input,
        terrain_error_m=terrain_error,
    )
    return SimulatedScene(write_pair(simulate_pair(options, progress), folder))


def _distortion(
    kind: str, shift_px: float, asked: Mapping[str, float | None], side_px: int
) -> DistortionOptions:
    for name, value in asked.items():
        if value is not None and kind not in _OF_DISTORTIONS[name]:
            those = " and ".join(_OF_DISTORTIONS[name])
            raise ParameterError(f"a {name} ({name}) goes with the distortions {those}, not {kind}")
    usual = {**_USUAL, "warp": min(_USUAL["warp"], side_px // 20)}
    given = {name: value for name, value in asked.items() if value is not None}
    return DistortionOptions(kind, shift_px, *(usual | given).values())
