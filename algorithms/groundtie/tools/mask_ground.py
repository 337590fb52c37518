"""Mask all of a radar image of a town but the ground between its buildings."""

from __future__ import annotations

from ..declaration import given_files, tool
from ..masks.ground import find_ground
from ..masks.scene import Scene, write_mask
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import open_raster
from .parameters import general
from .results import SHARE_OUTPUT, WrittenMask


@tool(title="Mask by layover and shadow", group="Radar", outputs=(SHARE_OUTPUT,))
def mask_ground(
    input: general.Radar,
    output: general.MaskOut,
    band: general.RadarBand = None,
    progress: Progress = SILENT,
) -> WrittenMask:
    """Mask all of a radar image of a town but the ground between its buildings.

    Ground lies apart from layover and radar shadow: behind the shadow of one building and before
    the layover of the next. The mask is for the registration of this image; `coregister` makes
    the same one itself of a town.
    """
    with open_raster(input) as source:
        scene = Scene.of(source, band)
        ground = find_ground(scene, progress.part(0.0, 0.7))
        with Outputs() as outputs:
            share = write_mask(scene, outputs.stage(output), ground.select, progress.part(0.7, 1.0))
    files = given_files({"mask": output})
    return WrittenMask(share, {}, "between layover and radar shadow", files)
