"""The directories of a TIFF file, with the positions of all blocks of its images.

GDAL makes the tags, except for size and blocks (see `tags_of`). The pixels are written by Python
(see `tiff_file`), where a full disk raises an exception. Within GDAL, libtiff may end the process
on a full disk, or silently write a file that lacks pixels.

Source: [Adobe1992], [OGC2023].
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .windows import Window

BLOCK = 512

# Tags, and the types of values with their sizes in bytes.
_KIND, _WIDTH, _HEIGHT, _BITS, _COMPRESSION, _COLOURS = 254, 256, 257, 258, 259, 262
_SAMPLES, _PLANES, _PALETTE, _OFFSETS, _COUNTS = 277, 284, 320, 324, 325
_PREDICTOR, _TILE_WIDTH, _TILE_HEIGHT, _EXTRA, _FORMAT, _NODATA = 317, 322, 323, 338, 339, 42113
_ASCII, _SHORT, _LONG, _LONG8 = 2, 3, 4, 16
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 16: 8, 17: 8}

# Tags that an overview shares with its image.
_SHARED = (_BITS, _COMPRESSION, _COLOURS, _SAMPLES, _PLANES, _PREDICTOR, _PALETTE, _TILE_WIDTH,
           _TILE_HEIGHT, _EXTRA, _FORMAT, _NODATA)  # fmt: skip

# Kinds of images, which may be combined.
_OVERVIEW, _MASK = 1, 4
_COLOURS_OF_MASK, _UNSIGNED = 4, 1

# Declaration of the blocks' layout in a Cloud Optimized GeoTIFF: each block is preceded by its
# size, and followed by a copy of its last bytes. Source: [OGC2023].
_COG = b"""LAYOUT=IFDS_BEFORE_DATA
BLOCK_ORDER=ROW_MAJOR
BLOCK_LEADER=SIZE_AS_UINT4
BLOCK_TRAILER=LAST_4_BYTES_REPEATED
KNOWN_INCOMPATIBLE_EDITION=NO
 """
AROUND_COG_BLOCK = 4

Tag = tuple[int, int, bytes]
Tags = dict[int, Tag]


@dataclass
class Image:
    """One image of a file: the raster or an overview, each with its mask, or such a mask.

    Parameters
    ----------
    width, height
        Size in pixels.
    tags
        Type, count and bytes of each tag's value, by number of the tag.
    planes
        Number of planes of its bands: 1, or one for each band.
    mask
        Mask of its valid pixels, or None.
    offsets, counts
        Position and size of each block in bytes, shape (planes, rows, cols); 0: not yet written.
    """

    width: int
    height: int
    tags: Tags
    planes: int = 1
    mask: Image | None = None
    offsets: NDArray[np.uint64] = field(init=False)
    counts: NDArray[np.uint64] = field(init=False)

    def __post_init__(self) -> None:
        shape = (self.planes, -(-self.height // BLOCK), -(-self.width // BLOCK))
        self.offsets, self.counts = np.zeros(shape, np.uint64), np.zeros(shape, np.uint64)

    @property
    def images(self) -> list[Image]:
        """The image and its mask, in the order of their directories."""
        return [self] if self.mask is None else [self, self.mask]

    def overview(self) -> Image:
        """Return an image of half this size, with its mask, without blocks yet."""
        width, height = -(-self.width // 2), -(-self.height // 2)
        kind = _OVERVIEW | _number(self.tags.get(_KIND, _short(0)))
        shared = {tag: self.tags[tag] for tag in _SHARED if tag in self.tags}
        mask = None if self.mask is None else self.mask.overview()
        return Image(width, height, {**shared, _KIND: _long(kind)}, self.planes, mask)

    def blocks(self, window: Window) -> Iterator[tuple[int, int, Window]]:
        """Yield the row and column of each block that a window touches, and the block's pixels."""
        for row in range(window.row // BLOCK, -(-(window.row + window.height) // BLOCK)):
            for col in range(window.col // BLOCK, -(-(window.col + window.width) // BLOCK)):
                left, top = col * BLOCK, row * BLOCK
                size = min(BLOCK, self.width - left), min(BLOCK, self.height - top)
                yield row, col, Window(left, top, *size)

    def entries(self, big: bool) -> list[tuple[int, Tag]]:
        """Return all entries of the directory, in the order of the tags."""
        kind, dtype = (_LONG8, "<u8") if big else (_LONG, "<u4")
        size = self.offsets.size
        made: Tags = {
            _WIDTH: _long(self.width),
            _HEIGHT: _long(self.height),
            _OFFSETS: (kind, size, self.offsets.astype(dtype).tobytes()),
            _COUNTS: (_LONG, size, self.counts.astype("<u4").tobytes()),
        }
        return sorted({**self.tags, **made}.items())


def base_image(template: bytes, width: int, height: int, masked: bool, nodata: int | None) -> Image:
    """Return the image of a raster with the tags of a template, without blocks yet.

    Parameters
    ----------
    template
        A classic TIFF file, little endian, with the same bands and blocks.
    width, height
        Size in pixels.
    masked
        Whether the image has a mask, of one bit a pixel.
    nodata
        The nodata value of integers; None: the template's. rasterio writes large ones as
        floating-point numbers, of which GDAL reads the digits before the decimal point.
    """
    tags = tags_of(template)
    if nodata is not None:
        text = f"{nodata}\0".encode()
        tags[_NODATA] = (_ASCII, len(text), text)
    separate = _number(tags[_PLANES]) == 2
    of_mask = {
        _KIND: _long(_MASK),
        _BITS: _short(1),
        _COMPRESSION: tags[_COMPRESSION],
        _COLOURS: _short(_COLOURS_OF_MASK),
        _SAMPLES: _short(1),
        _PLANES: _short(1),
        _TILE_WIDTH: _short(BLOCK),
        _TILE_HEIGHT: _short(BLOCK),
        _FORMAT: _short(_UNSIGNED),
    }
    mask = Image(width, height, of_mask) if masked else None
    return Image(width, height, tags, _number(tags[_SAMPLES]) if separate else 1, mask)


def tags_of(content: bytes) -> Tags:
    """Return the tags of the first image of a classic TIFF file, little endian."""
    order, version, start = struct.unpack_from("<2sHI", content)
    if (order, version) != (b"II", 42):
        raise ValueError("not a classic TIFF file, little endian")
    (count,) = struct.unpack_from("<H", content, start)
    tags: Tags = {}
    for i in range(count):
        place = start + 2 + 12 * i
        tag, kind, number = struct.unpack_from("<HHI", content, place)
        size = _SIZES[kind] * number
        where = place + 8 if size <= 4 else struct.unpack_from("<I", content, place + 8)[0]
        tags[tag] = (kind, number, content[where : where + size])
    return tags


def header(images: Sequence[Image], big: bool, cog: bool = False) -> bytes:
    """Return the start of a file: the directories of its images, before all blocks.

    Its length depends only on the sizes of the images, not on the positions of the blocks. The
    header of only the first images has the same layout.

    Parameters
    ----------
    images
        The raster first, each mask after its image.
    big
        Whether offsets have 64 bits.
    cog
        Whether the blocks are ordered as in a Cloud Optimized GeoTIFF.
    """
    ghost = b"GDAL_STRUCTURAL_METADATA_SIZE=%06d bytes\n" % len(_COG) + _COG if cog else b""
    start = (16 if big else 8) + len(ghost)
    start += start % 2
    first = struct.pack("<2sHHHQ", b"II", 43, 8, 0, start) if big else None
    parts = [first or struct.pack("<2sHI", b"II", 42, start), ghost]
    parts.append(bytes(start - sum(map(len, parts))))
    for i, image in enumerate(images):
        directory = _directory(image.entries(big), start, big, last=i == len(images) - 1)
        parts.append(directory)
        start += len(directory)
    return b"".join(parts)


def _directory(entries: list[tuple[int, Tag]], start: int, big: bool, last: bool) -> bytes:
    """Return a directory at `start`, followed by its values and then by the next directory."""
    count, entry, word = ("<Q", "<HHQ", "<Q") if big else ("<H", "<HHI", "<I")
    width = struct.calcsize(word)
    behind = start + struct.calcsize(count) + len(entries) * (4 + 2 * width) + width
    table, values = [struct.pack(count, len(entries))], [b""]
    for tag, (kind, number, content) in entries:
        if len(content) <= width:
            place = content.ljust(width, b"\0")
        else:
            place = struct.pack(word, behind)
            values.append(content + bytes(len(content) % 2))
            behind += len(values[-1])
        table.append(struct.pack(entry, tag, kind, number) + place)
    table.append(struct.pack(word, 0 if last else behind))
    return b"".join([*table, *values])


def _short(value: int) -> Tag:
    return _SHORT, 1, struct.pack("<H", value)


def _long(value: int) -> Tag:
    return _LONG, 1, struct.pack("<I", value)


def _number(tag: Tag) -> int:
    return int.from_bytes(tag[2][: _SIZES[tag[0]]], "little")
