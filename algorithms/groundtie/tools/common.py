"""Parameters that several tools share, declared once."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from ..kinds import Choice, Number, RasterIn, RasterOut
from ..rasters.warping import METHODS

Reference = Annotated[
    Path, RasterIn(label="Reference image", help="The image whose georeferencing is right.")
]
Input = Annotated[Path, RasterIn(label="Input image", help="The image to be registered.")]
Output = Annotated[
    Path,
    RasterOut(
        label="Registered image",
        help="GeoTIFF with the input's bands, data type, nodata value, colours and metadata.",
    ),
]
Resampling = Annotated[
    str,
    Choice(
        label="Resampling",
        help="How values between the input's pixels are found. Where output pixels are larger "
        "than 1.5 input pixels, the mean of the area is taken first, but for nearest. Images "
        "with a palette are always resampled by nearest.",
        choices=METHODS,
        advanced=True,
    ),
]
Workers = Annotated[
    int | None,
    Number(
        label="Workers",
        help="Number of threads; by default one per processor.",
        integer=True,
        minimum=1,
        maximum=256,
        advanced=True,
    ),
]

Seed = Annotated[
    int,
    Number(
        label="Seed",
        help="Seed of random samples: the same seed gives the same result.",
        integer=True,
        minimum=0,
        maximum=2**31 - 1,
        advanced=True,
    ),
]


def worker_count(workers: int | None) -> int:
    """Return the number of threads to use: as asked for, or one per processor."""
    return workers or os.cpu_count() or 1
