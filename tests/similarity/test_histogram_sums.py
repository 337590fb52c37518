"""Sums of histograms are identical to the last digit for every memory layout."""

from __future__ import annotations

import numpy as np
import pytest

from groundtie.similarity.measures import normalized_mutual_information, pairwise_sum


@pytest.mark.parametrize("cells", [1, 7, 8, 10, 64, 100, 144, 289, 1024])
def test_sums_are_numpys_along_contiguous_memory(cells: int) -> None:
    table = (np.random.default_rng(cells).random((5, 6, cells)) * 1000).astype(np.float32)
    shifts_last = np.moveaxis(np.moveaxis(table, -1, 0).copy(), 0, -1)
    np.testing.assert_array_equal(pairwise_sum(shifts_last), table.sum(axis=-1))
    np.testing.assert_array_equal(pairwise_sum(table), table.sum(axis=-1))


def test_similarity_is_the_same_with_shifts_first_and_last() -> None:
    joint = (np.random.default_rng(0).random((5, 6, 10, 12)) * 100).astype(np.float32)
    shifts_last = np.moveaxis(np.moveaxis(joint, (2, 3), (0, 1)).copy(), (0, 1), (2, 3))
    np.testing.assert_array_equal(
        normalized_mutual_information(shifts_last), normalized_mutual_information(joint)
    )
