"""Simulate an optical image in sensor geometry, with RPCs whose errors are known exactly."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..declaration import tool
from ..kinds import Distance, FolderOut, Number
from ..progress import SILENT, Progress
from ..simulation.attitude import AttitudeOptions
from ..simulation.optical import OpticalOptions
from ..simulation.sar import SarOptions
from ..simulation.scene import SceneOptions
from ..simulation.sensor_files import write_sensor_image
from ..simulation.sensor_image import SensorOptions, simulate_sensor_image
from .parameters import general, simulated
from .results import SimulatedScene


@tool(title="Simulate a sensor image", group="Simulation")
def simulate_sensor(
    folder: Annotated[
        Path,
        FolderOut(
            help="Gets sensor.tif (optical, with RPCs), reference.tif (SAR), dem.tif, "
            "dsm.tif, reference.json and sensor.json (view angles), exact_rpc.txt, truth.json, "
            "check_points.csv and roof_points.csv.",
            shows=("reference.tif",),
        ),
    ],
    size: simulated.Size = 1000,
    density: simulated.Density = "suburban",
    relief: Annotated[float, Distance(help="Range of the terrain's heights.", maximum=1000)] = 60.0,
    shift: Annotated[
        float,
        Distance(
            help="How far off on the ground the RPCs are; the direction is drawn.",
            maximum=2000,
        ),
    ] = 60.0,
    drift: Annotated[
        float,
        Number(
            help="How much their error changes from the first line of the image to the last.",
            unit="px",
            minimum=0,
            maximum=50,
        ),
    ] = 2.0,
    rotation: Annotated[
        float,
        Number(
            help="How far they are rotated about the centre of the image.",
            unit="°",
            minimum=-1,
            maximum=1,
        ),
    ] = 0.0,
    off_nadir: simulated.OffNadir = 20.0,
    looks: simulated.Looks = 1.0,
    changed: simulated.Changed = 0.0,
    seed: general.Seed = 0,
    pixel_size: simulated.PixelSize = 1.0,
    incidence: simulated.Incidence = 35.0,
    orbit: simulated.Orbit = "ascending",
    view_azimuth: simulated.ViewAzimuth = 250.0,
    heading: Annotated[
        float,
        Number(
            help="Where the satellite with the camera flies to, clockwise from north.",
            unit="°",
            minimum=0,
            maximum=360,
            advanced=True,
        ),
    ] = 193.0,
    progress: Progress = SILENT,
) -> SimulatedScene:
    """Simulate an optical image in sensor geometry, with RPCs whose errors are known exactly.

    A push-broom camera in orbit looks at a scene with terrain and buildings; its image is not
    orthorectified. The RPCs in the image's tags are wrong by an error of attitude, those in
    exact_rpc.txt are right. The SAR image of the same ground lies on the map.
    """
    options = SensorOptions(
        scene=SceneOptions((size, size), pixel_size, density, relief, seed, changed / 100),
        sar=SarOptions(incidence_deg=incidence, orbit=orbit, looks=looks),
        optical=OpticalOptions(view_azimuth_deg=view_azimuth, off_nadir_deg=off_nadir),
        attitude=AttitudeOptions(shift, drift, rotation),
        heading_deg=heading,
    )
    made = simulate_sensor_image(options, progress)
    return SimulatedScene(write_sensor_image(made, folder))
