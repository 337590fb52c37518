"""Masks of dates: drawn once a date on its own pixels, so that they move with these."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

from ..masks.scene import Scene, Select, Selection
from ..progress import Progress
from ..rasters.pair import Image
from ..rasters.reading import RasterSource, Window, open_raster
from ..registration.user_masks import UserMask, drawn_mask, select_drawn


def draw_mask(source: RasterSource, mask: UserMask, stack: ExitStack, progress: Progress) -> Image:
    """Return a date with a mask on its own pixels, drawn of a raster or a layer of what is hidden.

    Parameters
    ----------
    source
        The date.
    mask
        Its mask; `UserMask.is_drawn` states which are drawn.
    stack
        Keeps the drawn mask until it is closed.
    progress
        Receives every tile.
    """
    scene = Scene.of(source)
    with ExitStack() as own:
        select = _selection(scene, source, mask, own)
        raster, share = drawn_mask(scene, select, stack, progress)
    return mask.noted(replace(Image(source), mask=raster), share, source.path)


def _selection(scene: Scene, source: RasterSource, mask: UserMask, stack: ExitStack) -> Select:
    if mask.values is not None:
        return select_drawn(scene, mask, stack)
    raster = stack.enter_context(open_raster(mask.mask))
    grid = source.grid
    image = Image(source).masked(raster, grid)

    def select(window: Window) -> Selection:
        valid = scene.read(window).valid
        shown = image.shown_on(grid.window(*window), grid.map_to_pixel)
        return Selection(valid & shown, valid)

    return select
