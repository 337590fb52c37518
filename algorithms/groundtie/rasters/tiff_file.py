"""TIFF files, written block by block by Python itself, so that failures become exceptions.

The blocks lie in the file in the order of their completion, for any number of compressing threads:
the same pixels give the same bytes.
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

# Largest compression ratio of Deflate: two bits for 258 bytes, [Deutsch1996] 3.2.5.
_BEST_COMPRESSION = 1032

# Files that may be larger become BigTIFF: as with GDAL's IF_SAFER, well below TIFF's limit.
_LARGEST_CLASSIC = 2_000_000_000


@dataclass
class _Open:
    """A block that is written in part."""

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
        Size of its pixels, uncompressed.
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
        Type of its pixels.
    bands
        Number of bands.
    executor
        Executor that compresses blocks.
    ahead
        Largest number of blocks waiting to be written.
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
            # Unbuffered: closing the file must not retry a failed write.
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
        """Write pixels of some bands, each pixel once; the arrays must not change afterwards.

        Parameters
        ----------
        values
            Shape (bands, h, w), or (h, w) for a single band.
        indexes
            The bands, from 1; None: all. If all bands share one plane, all must be given.
        window
            Window of the pixels; None: the whole image.
        valid
            Validity of the pixels, shape (h, w); 0 is invalid. Written as the mask, if the file has
            one, along with the first band only.
        level
            0: the raster; then its overviews from large to small.
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
        """Write all pending blocks, and a header that makes the first levels readable."""
        self._write_coming(0)
        images = [image for level in self.levels[:levels] for image in level.images]
        if not all(image.counts.all() for image in images):
            raise ValueError("not all blocks were written")
        with writing(self.path):
            self._file.seek(0)
            _write(self._file, header(images, self._big))
            self._file.seek(0, os.SEEK_END)

    def copy_as_cog(self, path: Path) -> None:
        """Write the finished file as a Cloud Optimized GeoTIFF, with the smallest level first."""
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
        """Size of all pixels in bytes, uncompressed."""
        pixel = self.bands * self.pixels.memory.itemsize
        masked = self.levels[0].mask is not None
        sizes = (level.width * level.height for level in self.levels)
        return sum(size * pixel + masked * (size // 8) for size in sizes)

    @cached_property
    def _big(self) -> bool:
        """Whether the file may become too large for a classic TIFF."""
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
        """Add a part to a block; return the block if that completes it."""
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
        """Write blocks, in the order of their completion, until at most `most` are waiting."""
        while len(self._coming) > most:
            coming = self._coming.popleft()
            content = coming.content.result()
            coming.image.offsets[coming.place] = self._file.tell()
            self._done_bytes += coming.raw_bytes
            self._append(content)
            coming.image.counts[coming.place] = len(content)

    def _append(self, content: bytes) -> None:
        size = self._file.tell() + len(content)
        # Size needed if the rest compresses as well as the blocks so far.
        share = min(self._done_bytes / self._raw_bytes, 1)
        with writing(self.path, round(size / share) if share else None):
            _write(self._file, content)


def _write(file: IO[bytes], content: bytes) -> None:
    left = memoryview(content)
    while left:
        left = left[file.write(left) :]
