"""Masks of dates: drawn once a date on its own pixels, so that they move with these."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace

from ..masks.scene import Scene, Select, Selection
from ..progress import Progress
from ..rasters.pair import Image
from ..rasters.reading import RasterSource, Window, open_raster
from ..registration.user_masks import UserMask, drawn_mask, select_drawn


@dataclass(frozen=True)
class DateMask:
    """A mask on the pixels of a date.

    Parameters
    ----------
    raster
        1 where pixels take part, else 0; on the date's own grid.
    hides
        See `Image.mask_hides`.
    note
        What a user should know of it.
    """

    raster: RasterSource
    hides: bool
    note: str

    def on(self, image: Image) -> Image:
        """Return the date's image with this mask, wherever its pixels were moved."""
        moved = replace(self.raster, grid=image.source.grid)
        return replace(image, mask=moved, mask_hides=self.hides, mask_note=self.note)


def draw_mask(
    source: RasterSource, mask: UserMask, stack: ExitStack, progress: Progress
) -> DateMask:
    """Draw a raster, or a layer of what takes no part, on the pixels of a date.

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
    note = f"{mask.name}{mask.origin} keeps {share:.0%} of {source.path}"
    return DateMask(raster, mask.values is not None, note)


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
