"""TIFF files, written block by block by Python itself: what goes wrong is an exception.

The blocks lie in the file in the order in which they were completed, whatever the number of threads
that compress: the same pixels make the same bytes.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .atomic import free_bytes, no_space, writing
from .tiff_blocks import PixelType, encoded_mask
from .tiff_directories import AROUND_COG_BLOCK, Image, header
from .windows import Window

# Deflate makes no more than this out of a byte: two bits for 258 of them, [Deutsch1996] 3.2.5.
_BEST_COMPRESSION = 1032

# BigTIFF begins where the offsets of TIFF end; as GDAL's IF_SAFER, well before.
_LARGEST_CLASSIC = 2_000_000_000


@dataclass
class _Open:
    """A block of which a part is known."""

    values: NDArray[Any]
    missing: int


@dataclass(frozen=True)
class _Coming:
    """A block that is being compressed."""

    image: Image
    place: tuple[int, int, int]
    raw_bytes: int
    content: Future[bytes]


def require_space(path: Path, raw_bytes: int) -> None:
    """Raise `OutputError` if pixels cannot fit on the disk, however well they compress.

    Parameters
    ----------
    path
        The file.
    raw_bytes
        Of its pixels, not compressed.
    """
    least = raw_bytes // _BEST_COMPRESSION
    with writing(path):
        if least > free_bytes(path):
            raise no_space(path, least)


@dataclass
class TiledFile:
    """A raster that is being written.

    Parameters
    ----------
    path
        The file; see `atomic.Outputs.stage`.
    levels
        The raster and its overviews.
    pixels
        The type of its pixels.
    bands
        How many there are.
    executor
        Where blocks are compressed.
    ahead
        How many wait to be written, at most.
    """

    path: Path
    levels: Sequence[Image]
    pixels: PixelType
    bands: int
    executor: Executor
    ahead: int
    _file: IO[bytes] = field(init=False)
    _open: dict[tuple[int, int, int, int], _Open] = field(init=False, default_factory=dict)
    _coming: deque[_Coming] = field(init=False, default_factory=deque)
    _done_bytes: int = field(init=False, default=0)

    def __enter__(self) -> TiledFile:
        with writing(self.path):
            # Without a buffer: what cannot be written must not be tried again when it is closed.
            self._file = self.path.open("w+b", buffering=0)
            try:
                _write(self._file, bytes(len(header(self._images, self._big))))
            except OSError:
                self._file.close()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        for coming in self._coming:
            coming.content.cancel()
        self._file.close()

    def write(
        self,
        values: NDArray[Any],
        indexes: Sequence[int] | None = None,
        *,
        window: Window | None = None,
        valid: NDArray[Any] | None = None,
        level: int = 0,
    ) -> None:
        """Write pixels of some bands; each must be written once, and not change any more.

        Parameters
        ----------
        values
            Shape (bands, h, w), or (h, w) for a single band.
        indexes
            The bands, from 1; None: all. Where all lie in one plane they must be all.
        window
            Their place; None: the whole image.
        valid
            Which pixels are valid, shape (h, w): all but 0. It becomes the mask, if the file has
            one, and counts beside the first band only.
        level
            0: the raster; else its overviews in the order of their sizes.
        """
        image = self.levels[level]
        window = window or Window(0, 0, image.width, image.height)
        values = values.reshape(-1, *values.shape[-2:])
        numbers = range(1, self.bands + 1) if indexes is None else indexes
        if image.planes == 1:
            if len(values) != self.bands:
                raise ValueError("all bands of a plane are written together")
            self._put(image, 0, np.moveaxis(values, 0, -1), window, self.pixels.encoded)
        else:
            for number, band in zip(numbers, values, strict=True):
                self._put(image, number - 1, band[:, :, None], window, self.pixels.encoded)
        if image.mask is not None and valid is not None and 1 in numbers:
            self._put(image.mask, 0, valid != 0, window, encoded_mask)

    def finish(self, levels: int) -> None:
        """Write all blocks that were given, and let readers know the first levels."""
        self._write_coming(0)
        images = [image for level in self.levels[:levels] for image in level.images]
        if not all(image.counts.all() for image in images):
            raise ValueError("not all blocks were written")
        with writing(self.path):
            self._file.seek(0)
            _write(self._file, header(images, self._big))
            self._file.seek(0, os.SEEK_END)

    def copy_as_cog(self, path: Path) -> None:
        """Write a Cloud Optimized GeoTIFF of what is finished: the smallest level first."""
        start, copied = len(header(self._images, self._big, cog=True)), []
        for level in reversed(self.levels):
            for image in level.images:
                copied.append((image.offsets.copy(), image.counts))
                ends = start + np.cumsum(image.counts.ravel() + np.uint64(2 * AROUND_COG_BLOCK))
                starts = ends - image.counts.ravel() - np.uint64(AROUND_COG_BLOCK)
                image.offsets[:] = starts.reshape(image.offsets.shape)
                start = int(ends[-1])
        with writing(path, start), path.open("wb", buffering=0) as file:
            _write(file, header(self._images, self._big, cog=True))
            for offsets, counts in copied:
                for offset, count in zip(offsets.flat, counts.flat, strict=True):
                    self._file.seek(int(offset))
                    block = self._file.read(int(count))
                    leader = len(block).to_bytes(AROUND_COG_BLOCK, "little")
                    _write(file, leader + block + block[-AROUND_COG_BLOCK:])

    @cached_property
    def _images(self) -> list[Image]:
        return [image for level in self.levels for image in level.images]

    @cached_property
    def _raw_bytes(self) -> int:
        """Bytes of all pixels, not compressed."""
        pixel = self.bands * self.pixels.memory.itemsize
        masked = self.levels[0].mask is not None
        sizes = (level.width * level.height for level in self.levels)
        return sum(size * pixel + masked * (size // 8) for size in sizes)

    @cached_property
    def _big(self) -> bool:
        """Whether the file may grow beyond what a classic TIFF can hold."""
        directories = sum(16 * image.offsets.size for image in self._images)
        return self._raw_bytes + directories > _LARGEST_CLASSIC

    def _put(
        self,
        image: Image,
        plane: int,
        values: NDArray[Any],
        window: Window,
        encode: Callable[[NDArray[Any]], bytes],
    ) -> None:
        """Add pixels, shape (h, w, …), to the blocks in which they lie."""
        for row, col, whole in image.blocks(window):
            place = (plane, row, col)
            part = window.common(whole)
            rows, cols = part.slices_in(window)
            block = self._completed(image, place, values[rows, cols], part, whole)
            if block is not None:
                raw_bytes = block.size // 8 if encode is encoded_mask else block.nbytes
                content = self.executor.submit(encode, block)
                self._coming.append(_Coming(image, place, raw_bytes, content))
                self._write_coming(self.ahead)

    def _completed(
        self,
        image: Image,
        place: tuple[int, int, int],
        values: NDArray[Any],
        part: Window,
        whole: Window,
    ) -> NDArray[Any] | None:
        """Return a block to which a part was added, if it is complete by that."""
        if part == whole:
            return values
        key = (id(image), *place)
        block = self._open.get(key)
        if block is None:
            shape = (whole.height, whole.width, *values.shape[2:])
            block = _Open(np.zeros(shape, values.dtype), whole.width * whole.height)
            self._open[key] = block
        block.values[part.slices_in(whole)] = values
        block.missing -= part.width * part.height
        return None if block.missing else self._open.pop(key).values

    def _write_coming(self, most: int) -> None:
        """Write blocks, in the order in which they were completed, until few are left."""
        while len(self._coming) > most:
            coming = self._coming.popleft()
            content = coming.content.result()
            coming.image.offsets[coming.place] = self._file.tell()
            self._done_bytes += coming.raw_bytes
            self._append(content)
            coming.image.counts[coming.place] = len(content)

    def _append(self, content: bytes) -> None:
        size = self._file.tell() + len(content)
        # If the rest compresses as well as what is done.
        share = min(self._done_bytes / self._raw_bytes, 1)
        with writing(self.path, round(size / share) if share else None):
            _write(self._file, content)


def _write(file: IO[bytes], content: bytes) -> None:
    left = memoryview(content)
    while left:
        left = left[file.write(left) :]
