"""The context that tests of steps share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from groundtie.context import Context, threads


@pytest.fixture(scope="session")
def context() -> Iterator[Context]:
    with threads(2) as opened:
        yield opened


@pytest.fixture(scope="session")
def one_thread() -> Iterator[Context]:
    with threads(1) as opened:
        yield opened
