"""A context runs steps in order, reports them and ends when the work is cancelled."""

from __future__ import annotations

import pytest

from groundtie.context import threads
from groundtie.errors import CancelledError
from groundtie.progress import Progress


def test_map_keeps_the_order_and_reports_every_item() -> None:
    reported: list[float] = []
    with threads(2, Progress(lambda share, _: reported.append(share))) as context:
        assert list(context.map(lambda n: n * n, [3, 1, 2])) == [9, 1, 4]
        assert list(context.map(str, [])) == []
    assert reported == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_a_part_reports_its_share_of_the_whole() -> None:
    reported: list[float] = []
    with threads(1, Progress(lambda share, _: reported.append(share)), seed=7) as context:
        part = context.part(0.5, 1.0)
        part.update(0.5)
        part.quiet().update(1.0)
    assert reported == [0.75]
    assert (part.seed, part.workers) == (7, 1)


def test_cancelled_work_ends() -> None:
    with (
        threads(1, Progress(is_cancelled=lambda: True)) as context,
        pytest.raises(CancelledError),
    ):
        list(context.quiet().map(str, [1]))
