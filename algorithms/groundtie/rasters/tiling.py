"""Processing of rasters tile by tile, so that memory is bounded whatever their size."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from typing import TypeVar

from ..errors import GridSizeError
from .grid import Grid
from .reading import RasterSource
from .tiff_directories import BLOCK
from .windows import Window

# Tiles are blocks of the file, small enough to process those of a small raster in parallel.
_TILE = BLOCK

# Bytes of the result that a worker may hold; rasters with many bands are processed in groups.
_TILE_BYTES = 32_000_000

# Largest number of pixels to be processed one by one: a day at 10 million a second. The file of a
# map service may declare more pixels than there are bytes on Earth; parts of it are usable.
_MOST_PIXELS = 1e12

Item = TypeVar("Item")
Result = TypeVar("Result")


def require_workable(grid: Grid, what: str) -> Grid:
    """Return a grid, unchanged, whose pixels can be processed one by one.

    Raises
    ------
    GridSizeError
        There are too many pixels; `what` names the grid in the message.
    """
    if grid.width * grid.height > _MOST_PIXELS:
        raise GridSizeError(
            f"{what} has {grid.width} × {grid.height} pixels, more than can be worked through: "
            "take a part (gdal_translate -projwin) or larger pixels"
        )
    return grid


def tiles(grid: Grid, side: int | None = None) -> Iterator[Window]:
    """Yield the tiles that cover a grid, row by row; by default whole blocks of the file."""
    side = side or _TILE
    for row in range(0, grid.height, side):
        for col in range(0, grid.width, side):
            yield Window(col, row, min(side, grid.width - col), min(side, grid.height - row))


def tile_count(grid: Grid) -> int:
    """Return the number of tiles of a grid."""
    return -(-grid.height // _TILE) * -(-grid.width // _TILE)


def band_groups(source: RasterSource) -> tuple[tuple[int, ...], ...]:
    """Return a raster's band numbers, from 1, in groups whose tiles fit into a worker's memory."""
    most = max(_TILE_BYTES // (_TILE * _TILE * source.dtype.itemsize), 1)
    numbers = range(1, source.count + 1)
    return tuple(tuple(numbers[i : i + most]) for i in range(0, source.count, most))


def in_order(
    pool: Executor,
    work: Callable[[Item], Result],
    items: Iterable[Item],
    ahead: int,
) -> Iterator[Result]:
    """Process items in a pool, at most `ahead` at a time, and yield the results in order."""
    waiting: deque[Future[Result]] = deque()
    try:
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) >= ahead:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()
