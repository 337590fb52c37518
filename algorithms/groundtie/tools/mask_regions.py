"""Mask all of a radar image but homogeneous regions on the ground: roads, waters, squares."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..declaration import Output, given_files, tool
from ..kinds import RasterOut
from ..masks.regions import HIGH_PERCENT, WIDTH_M, find_regions
from ..masks.scene import Scene, write_mask
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import open_raster
from .parameters import general
from .results import SHARE_OUTPUT, WrittenMask


@tool(
    title="Mask by regions",
    group="Radar",
    outputs=(
        SHARE_OUTPUT,
        Output("SKELETON_M", "Length of the skeleton (m)", "skeleton_m"),
    ),
)
def mask_regions(
    input: general.Radar,
    output: general.MaskOut,
    regions: Annotated[
        Path | None,
        RasterOut(
            help="GeoTIFF that is 1 on homogeneous regions whose shape is that of roads, waters, "
            "fields or squares.",
        ),
    ] = None,
    skeleton: Annotated[
        Path | None,
        RasterOut(help="GeoTIFF that is 1 on the skeleton of long regions."),
    ] = None,
    mask_width: general.MaskWidth = WIDTH_M,
    mask_high_percent: general.HighPercent = HIGH_PERCENT,
    band: general.RadarBand = None,
    progress: Progress = SILENT,
) -> WrittenMask:
    """Mask all of a radar image but homogeneous regions on the ground: roads, waters, squares.

    Speckle is filtered, regions grow from homogeneous seeds, and those stay that are long or large
    and neither bright nor radar shadow. Long ones are thinned to their skeleton and broadened by a
    window; strong scatterers inside are masked. The mask is for the registration of this image.
    """
    files = given_files({"mask": output, "regions": regions, "skeleton": skeleton})
    with open_raster(input) as source:
        scene = Scene.of(source, band)
        found = find_regions(scene, mask_width, mask_high_percent, progress.part(0.0, 0.7))
        with Outputs() as outputs:
            share = write_mask(scene, outputs.stage(output), found.select, progress.part(0.7, 0.8))
            for path, part in ((regions, found.regions), (skeleton, found.skeleton)):
                if path is not None:
                    rest = progress.part(0.8, 1.0)
                    write_mask(scene, outputs.stage(path), part.select, rest)
    words = f"{found.skeleton_m:.0f} m of skeleton"
    return WrittenMask(share, {"skeleton_m": found.skeleton_m}, words, files)
