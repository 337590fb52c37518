"""What is made of equal arrays is made once, as long as there is room for it."""

from __future__ import annotations

from itertools import count

import numpy as np

from groundtie.memo import Memo


def test_equal_arrays_recall_what_was_made_of_them() -> None:
    memo, made = Memo(100), count()
    ones = np.ones((2, 6), np.float32)
    assert memo.recall(lambda: [next(made)], 10, ones) == [0]
    # Of the same content, wherever it lies in memory.
    assert memo.recall(lambda: [next(made)], 10, np.ones((6, 4), np.float32)[:, ::2].T) == [0]
    # Of another content, another shape, and more arrays.
    for number, arrays in enumerate([(2 * ones,), (ones.reshape(3, 4),), (ones, ones)], 1):
        assert memo.recall(lambda: [next(made)], 10, *arrays) == [number]


def test_nothing_more_is_kept_than_there_is_room_for() -> None:
    memo, made = Memo(25), count()
    found = [memo.recall(lambda: next(made), 10, np.array([k % 3])) for k in range(9)]
    assert found == [0, 1, 2, 0, 1, 3, 0, 1, 4]
