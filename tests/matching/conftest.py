"""Pairs that the tests of the search share, opened once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from contexts import context, one_thread
from textured_pairs import TexturedPair, shift_on_map, write_textured_pair

from groundtie.rasters.pair import ImagePair

__all__ = ["context", "one_thread", "other_place", "pair", "textured"]


@pytest.fixture(scope="session")
def textured(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    """Return a pair of opposite contrast; the input lies nominally 70 m east, 45 m south."""
    return write_textured_pair(tmp_path_factory.mktemp("pair"), (260, 240), shift_on_map(70, -45))


@pytest.fixture(scope="session")
def other_place(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    """Return a pair of images of different places."""
    folder = tmp_path_factory.mktemp("other")
    return write_textured_pair(folder, (260, 240), shift_on_map(0, 0), input_seed=99)


@pytest.fixture(scope="session")
def pair(textured: TexturedPair) -> Iterator[ImagePair]:
    with textured.opened() as opened:
        yield opened
