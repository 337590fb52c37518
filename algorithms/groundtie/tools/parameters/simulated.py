"""Parameters of simulated scenes and of views of them, declared once."""

from __future__ import annotations

from typing import Annotated

from ...kinds import Choice, Distance, Number
from ...simulation.sar import ORBITS
from ...simulation.scene import DENSITY_NAMES

Size = Annotated[
    int,
    Number(
        help="Width and height of the scene.",
        unit="px",
        integer=True,
        minimum=64,
        maximum=20_000,
    ),
]
Density = Annotated[
    str,
    Choice(
        help="How much of the scene is built up: rural up to 3 %, suburban up to 25 %, urban "
        "about half, with high buildings; city has streets with cars, courtyards and towers.",
        choices=DENSITY_NAMES,
    ),
]
Looks = Annotated[
    float,
    Number(
        help="Number of looks of the SAR image: fewer are noisier.",
        minimum=1,
        maximum=100,
    ),
]
Changed = Annotated[
    float,
    Number(
        label="Changed buildings",
        help="Share of the buildings that stand in one of the images only: half of them are "
        "pulled down after the SAR image, half are new in the optical one.",
        unit="%",
        minimum=0,
        maximum=100,
    ),
]
PixelSize = Annotated[
    float,
    Distance(help="Pixel size of the SAR image.", minimum=0.1, advanced=True),
]
Incidence = Annotated[
    float,
    Number(
        label="Incidence angle",
        help="Angle between the radar's line of sight and the vertical.",
        unit="°",
        minimum=15,
        maximum=60,
        advanced=True,
    ),
]
Orbit = Annotated[
    str,
    Choice(
        help="Ascending: the radar looks east; descending: it looks west.",
        choices=ORBITS,
        advanced=True,
    ),
]
OffNadir = Annotated[
    float,
    Number(
        label="Off-nadir angle",
        help="Camera's line of sight from the vertical; relief displacement grows with it.",
        unit="°",
        minimum=0,
        maximum=45,
        advanced=True,
    ),
]
ViewAzimuth = Annotated[
    float,
    Number(
        help="Where the camera is, seen from the ground, clockwise from north.",
        unit="°",
        minimum=0,
        maximum=360,
        advanced=True,
    ),
]
