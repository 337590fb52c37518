"""Damage to files: to bytes of binary files, to words and structure of text."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

Random = np.random.Generator

# The headers of binary files lie mostly at their beginning.
_HEADER = 700

_NASTY_NUMBERS = (
    b"nan", b"inf", b"-Infinity", b"1e300", b"-1e300", b"1e-300", b"1e400", b"0", b"-0.0", b"-1",
    b"99999999999999999999", b"2147483647", b"2147483648", b"-2147483649", b"65536", b"0x10", b"",
    b"1e9", b"-9999", b"10" * 200, b"null", b"true", b"[]", b"{}", b'"x"',
)  # fmt: skip
_NASTY_TEXTS = (
    b"", b"\xff\xfe", b"x" * 140_000, b"EPSG:4978", b"EPSG:5773", b"EPSG:0", b"EPSG:4326",
    b"LOCAL_CS[\\\"x\\\",UNIT[\\\"metre\\\",1]]", b"../../x", b"/dev/zero", b"\x00", b"used",
    b"Float64", b"CFloat32", b"tps", b"polynomial3",
)  # fmt: skip
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w.]*")


def mutate(content: bytes, random: Random, *, is_text: bool) -> bytes:
    """Return content with one to four damages; with fewer of them, a reader gets farther."""
    ways = _TEXT_WAYS if is_text else _BYTE_WAYS
    for _ in range(int(random.choice([1, 1, 1, 2, 4]))):
        if content:
            content = ways[int(random.integers(len(ways)))](content, random)
    return content


def _place(content: bytes, random: Random) -> int:
    size = len(content) if random.random() < 0.3 else min(len(content), _HEADER)
    return int(random.integers(max(size, 1)))


def _flip(content: bytes, random: Random) -> bytes:
    at = _place(content, random)
    return content[:at] + bytes([content[at] ^ 1 << int(random.integers(8))]) + content[at + 1 :]


def _overwrite(content: bytes, random: Random) -> bytes:
    size = int(random.choice([1, 2, 4, 8]))
    value = int(random.choice([0, 1, 2, 255, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1]))
    order = "little" if random.random() < 0.8 else "big"
    new = (value % (1 << 8 * size)).to_bytes(size, order)  # type: ignore[arg-type]
    at = _place(content, random)
    return content[:at] + new + content[at + size :]


def _random_bytes(content: bytes, random: Random) -> bytes:
    at, size = _place(content, random), int(random.integers(1, 40))
    return content[:at] + random.bytes(size) + content[at + size :]


def _cut(content: bytes, random: Random) -> bytes:
    at = _place(content, random)
    return content[:at] + content[at + int(random.integers(1, 64)) :]


def _truncate(content: bytes, random: Random) -> bytes:
    return content[: int(random.integers(len(content)))]


def _repeat(content: bytes, random: Random) -> bytes:
    at, size = _place(content, random), int(random.integers(1, 64))
    return content[: at + size] + content[at:]


def _swap_word(pattern: re.Pattern[bytes], by: tuple[bytes, ...]) -> Callable[..., bytes]:
    def swap(content: bytes, random: Random) -> bytes:
        found = list(pattern.finditer(content))
        if not found:
            return content
        match = found[int(random.integers(len(found)))]
        new = by[int(random.integers(len(by)))]
        return content[: match.start()] + new + content[match.end() :]

    return swap


def _lines(content: bytes, random: Random) -> bytes:
    """Remove, duplicate or move a line, element or field."""
    separator = next((s for s in (b"\n", b"><", b",") if content.count(s) > 3), b" ")
    lines = content.split(separator)
    at = int(random.integers(len(lines)))
    line = lines.pop(at)
    way = int(random.integers(3))
    if way == 1:
        lines[at:at] = [line] * int(random.choice([2, 3, 50]))
    elif way == 2:
        lines.insert(int(random.integers(len(lines) + 1)), line)
    return separator.join(lines)


def _nest(content: bytes, random: Random) -> bytes:
    at = _place(content, random)
    return content[:at] + random.choice([b"[", b"{", b"<a>", b"("]) * 20_000 + content[at:]


_BYTE_WAYS = (_flip, _overwrite, _overwrite, _random_bytes, _cut, _truncate, _repeat)
_TEXT_WAYS = (
    _swap_word(_NUMBER, _NASTY_NUMBERS),
    _swap_word(_NUMBER, _NASTY_NUMBERS),
    _swap_word(_NUMBER, _NASTY_NUMBERS),
    _swap_word(_WORD, _NASTY_TEXTS),
    _lines,
    _flip,
    _random_bytes,
    _cut,
    _truncate,
    _nest,
)
