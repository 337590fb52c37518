from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import entropy
from sklearn.metrics import mutual_info_score

from groundtie.similarity.measures import normalized_mutual_information

TABLES = arrays(float, st.tuples(st.integers(2, 8), st.integers(2, 8)), elements=st.integers(0, 99))


def test_independent_images_share_nothing() -> None:
    table = np.outer([1.0, 2, 3, 4], [5.0, 1, 2])
    assert normalized_mutual_information(table) == pytest.approx(1.0)


def test_identical_images_share_all() -> None:
    assert normalized_mutual_information(np.diag([3.0, 1, 7, 2])) == pytest.approx(2.0)
    reordered = np.diag([3.0, 1, 7, 2])[:, [2, 0, 3, 1]]
    assert normalized_mutual_information(reordered) == pytest.approx(2.0)


@pytest.mark.parametrize("p", [0.05, 0.2, 0.5])
def test_a_symmetric_channel_in_closed_form(p: float) -> None:
    """Both images are fair coins that differ with probability p: (1 + 1) / (1 + h(p)) in bits."""
    table = 1000 * np.array([[1 - p, p], [p, 1 - p]]) / 2
    h = -p * np.log2(p) - (1 - p) * np.log2(1 - p)
    assert normalized_mutual_information(table) == pytest.approx(2 / (1 + h))


@settings(max_examples=80, deadline=None)
@given(table=TABLES)
def test_against_entropies_of_scipy_and_scikit_learn(table: np.ndarray) -> None:
    found = float(normalized_mutual_information(table))
    joint = entropy(table.ravel()) if table.sum() else 0.0
    if table.sum() == 0 or joint < 1e-9:
        assert found == 1.0
        return
    marginal = entropy(table.sum(axis=1)) + entropy(table.sum(axis=0))
    assert found == pytest.approx(marginal / joint, abs=1e-9)
    information = mutual_info_score(None, None, contingency=table.astype(int))
    assert found == pytest.approx(1 + information / joint, abs=1e-9)
    assert 1 - 1e-9 <= found <= 2 + 1e-9


@settings(max_examples=30, deadline=None)
@given(table=TABLES)
def test_which_image_comes_first_does_not_matter(table: np.ndarray) -> None:
    found = normalized_mutual_information(table)
    assert found == pytest.approx(float(normalized_mutual_information(table.T)))
    assert found == pytest.approx(float(normalized_mutual_information(table * 0.25)), abs=1e-9)


def test_many_histograms_at_once() -> None:
    rng = np.random.default_rng(0)
    tables = rng.uniform(0, 50, (3, 4, 6, 5)).astype(np.float32)
    tables[1, 2] = 0
    found = normalized_mutual_information(tables)
    assert found.shape == (3, 4)
    assert found[1, 2] == 1
    for i, j in np.ndindex(3, 4):
        alone = normalized_mutual_information(tables[i, j].astype(float))
        assert found[i, j] == pytest.approx(float(alone), abs=1e-5)
