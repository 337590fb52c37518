"""Mask the strong scatterers of a radar image, as buildings are."""

from __future__ import annotations

import math

from ..declaration import given_files, tool
from ..masks.scene import Scene, write_mask
from ..masks.threshold import HIGH_PERCENT, ThresholdMask
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import open_raster
from .parameters import general
from .results import SHARE_OUTPUT, WrittenMask


@tool(title="Mask by thresholds", group="Radar", outputs=(SHARE_OUTPUT,))
def mask_threshold(
    input: general.Radar,
    output: general.MaskOut,
    mask_high_percent: general.HighPercent = HIGH_PERCENT,
    mask_low_percent: general.LowPercent = 0.0,
    mask_growth: general.MaskGrowth = 0.0,
    band: general.RadarBand = None,
    progress: Progress = SILENT,
) -> WrittenMask:
    """Mask the strong scatterers of a radar image, as buildings are.

    The thresholds are percentiles of the means over blocks of 4 × 4 pixels; whole blocks take
    part or do not. The mask is for the registration of this image.
    """
    with open_raster(input) as source:
        scene = Scene.of(source, band)
        searching = progress.part(0.0, 0.3)
        mask = ThresholdMask.of(scene, mask_high_percent, mask_low_percent, mask_growth, searching)
        with Outputs() as outputs:
            share = write_mask(scene, outputs.stage(output), mask.select, progress.part(0.3, 1.0))
    limits = {"low": mask.low, "high": mask.high}
    finite = {name: at if math.isfinite(at) else None for name, at in limits.items()}
    words = _in_words(finite["low"], finite["high"])
    return WrittenMask(share, finite, words, given_files({"mask": output}))


def _in_words(low: float | None, high: float | None) -> str:
    if low is None:
        return "all block means" if high is None else f"block means of at most {high:g}"
    if high is None:
        return f"block means of at least {low:g}"
    return f"block means of {low:g} to {high:g}"
