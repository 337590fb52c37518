"""Mask all of an image but the ground that a surface model and the views of images leave."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ..declaration import Output, given_files, tool
from ..geometry.views import View, no_view, split_views, stated_view
from ..kinds import RasterOut
from ..masks.scene import Scene, write_mask, write_tiles
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import open_raster
from ..registration.specification import StatedSurface
from ..registration.surface_masks import fitted_ground
from .parameters import general, registration
from .results import SHARE_OUTPUT, WrittenMask


@tool(
    title="Mask by a surface model",
    group="Radar",
    outputs=(
        SHARE_OUTPUT,
        Output("CORRELATION", "Correlation with the surface model", "correlation"),
    ),
)
def mask_surface(
    reference: general.Reference,
    surface_model: Annotated[
        Path,
        replace(registration.SURFACE_MODEL, help=registration.SURFACE_HEIGHTS, advanced=False),
    ],
    output: general.MaskOut,
    reasons: Annotated[
        Path | None,
        RasterOut(
            help="GeoTIFF with why each pixel takes no part, as a sum: 1 raised, 2 layover, 4 "
            "radar shadow, 8 hidden from the camera, 16 cast shadow, 32 unknown.",
        ),
    ] = None,
    views: registration.SurfaceViews = None,
    progress: Progress = SILENT,
) -> WrittenMask:
    """Mask all of an image but the ground that a surface model and the views of images leave.

    Elevated objects are laid over the ground, hide it and cast shadows: that follows from heights
    and the angles of view, and is computed by casting rays. Without the view of the image that is
    to be registered, only what the reference itself does not show is masked. `coregister`,
    `extract_gcps` and `refine_rpc` make the same mask themselves if given a surface model.
    """
    own, other = split_views(views)
    view = View.of(reference, own)
    if view is None:
        raise no_view(reference, "reference")
    known = (view,) if other is None else (view, stated_view(other))
    files = given_files({"mask": output, "reasons": reasons})
    with ExitStack() as stack:
        scene = Scene.of(stack.enter_context(open_raster(reference)))
        ground, fit = fitted_ground(scene, StatedSurface(surface_model, known), stack)
        with Outputs() as outputs:
            share = write_mask(scene, outputs.stage(output), ground.select, progress.part(0.1, 0.6))
            if reasons is not None:
                write_tiles(scene, outputs.stage(reasons), ground.reasons, progress.part(0.6, 1.0))
    if fit is None:
        unknown = {"correlation": None, "offset_px": None}
        return WrittenMask(share, unknown, "nothing is expected of the image", files)
    numbers = {"correlation": fit.correlation, "offset_px": list(fit.offset_px)}
    words = f"the image correlates by {fit.correlation:.2f} with the surface model{fit.note}"
    return WrittenMask(share, numbers, words, files)
