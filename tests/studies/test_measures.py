from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import coo_matrix
from scipy.stats import entropy
from sklearn.metrics import mutual_info_score

from groundtie.similarity.measures import HistogramMeasure, normalized_mutual_information
from groundtie.studies.measures import (
    HISTOGRAM_MEASURES,
    cluster_reward,
    correlation_ratio,
    mutual_information,
    renyi_mutual_information,
    tsallis_mutual_information,
)

TABLES = arrays(float, st.tuples(st.integers(2, 8), st.integers(2, 8)), elements=st.integers(0, 99))
ORDERS = (-1.0, 0.0, 0.5, 0.999, 1.0, 2.0, 5.0)
ALL = {
    **HISTOGRAM_MEASURES,
    **{f"renyi {order:g}": renyi_mutual_information(order) for order in ORDERS},
    **{f"tsallis {order:g}": tsallis_mutual_information(order) for order in ORDERS},
}
each_measure = pytest.mark.parametrize("name", ALL)

# P(A) = (3/4, 1/4), P(B) = (1/2, 1/2), three occupied cells: 1/2, 1/4, 1/4.
SMALL = np.array([[2.0, 1.0], [0.0, 1.0]])


def nothing(name: str) -> float:
    """The value where nothing is shared."""
    return 1.0 if name == "nmi" else 0.0


@each_measure
def test_independent_images_share_nothing(name: str) -> None:
    table = np.outer([1.0, 2, 3, 4], [5.0, 1, 2])
    assert ALL[name](table) == pytest.approx(nothing(name), abs=1e-12)


@each_measure
@pytest.mark.parametrize(
    "table",
    [
        np.zeros((3, 4)),
        np.diag([0.0, 7, 0]),
        np.outer([1.0, 2, 0], [0.0, 5]),
        np.outer([0.0, 5], [3.0, 4, 5]),
    ],
    ids=["no pixel", "both constant", "B constant", "A constant"],
)
def test_images_without_content_share_nothing(name: str, table: np.ndarray) -> None:
    assert ALL[name](table) == pytest.approx(nothing(name), abs=1e-12)


def test_identical_images_share_all() -> None:
    counts = np.array([3.0, 1, 7, 2])
    own = entropy(counts)
    for table in (np.diag(counts), np.diag(counts)[:, [2, 0, 3, 1]]):
        assert mutual_information(table) == pytest.approx(own)
        assert normalized_mutual_information(table) == pytest.approx(2.0)
        assert cluster_reward(table) == pytest.approx(1.0)
        assert correlation_ratio(table) == pytest.approx(1.0)


@pytest.mark.parametrize("order", [-1.0, 0.5, 2.0, 3.0])
def test_identical_images_have_their_own_entropy(order: float) -> None:
    shares = np.array([3.0, 1, 7, 2]) / 13
    table = np.diag(shares)
    renyi = np.log(np.sum(shares**order)) / (1 - order)
    assert renyi_mutual_information(order)(table) == pytest.approx(renyi)
    tsallis = (1 - np.sum(shares**order)) / (order - 1)
    expected = tsallis + (1 - order) * tsallis**2
    assert tsallis_mutual_information(order)(table) == pytest.approx(expected)


@pytest.mark.parametrize("p", [0.05, 0.2, 0.5])
def test_a_symmetric_channel_in_closed_form(p: float) -> None:
    """Both images are fair coins that differ with probability p."""
    table = 1000 * np.array([[1 - p, p], [p, 1 - p]]) / 2
    h = -p * np.log(p) - (1 - p) * np.log(1 - p)
    same_or_not = (1 - p) ** 2 + p**2
    expected = {
        "mi": np.log(2) - h,
        "nmi": 2 * np.log(2) / (np.log(2) + h),
        "renyi": np.log(2 * same_or_not),
        "tsallis": same_or_not / 2 - 1 / 4,
        "cluster-reward": (1 - 2 * p) ** 2,
        "correlation-ratio": (1 - 2 * p) ** 2,
    }
    assert {
        name: pytest.approx(float(m(table)), abs=1e-12) for name, m in HISTOGRAM_MEASURES.items()
    } == (expected)


@pytest.mark.parametrize(
    ("alpha", "expected"),
    [
        (2.0, np.log(1.2)),
        (0.5, 2 * np.log((np.sqrt(3) + 1) / 2 * np.sqrt(2) / (np.sqrt(0.5) + 1))),
        (0.0, np.log(4 / 3)),
        (-1.0, np.log(32 / 15) / 2),
    ],
)
def test_renyi_by_hand(alpha: float, expected: float) -> None:
    assert renyi_mutual_information(alpha)(SMALL) == pytest.approx(expected)


@pytest.mark.parametrize(("q", "expected"), [(2.0, 1 / 16), (3.0, 3 / 128), (0.0, 1.0)])
def test_tsallis_by_hand(q: float, expected: float) -> None:
    """With q = 0 entropies count cells less 1: 1 + 1 + 1 · 1 · 1 - 2 = 1, where 2 · 2 - 3 = 1."""
    assert tsallis_mutual_information(q)(SMALL) == pytest.approx(expected)


def test_cluster_reward_and_correlation_ratio_by_hand() -> None:
    chance = np.sqrt(10 / 16 * 1 / 2)
    assert cluster_reward(SMALL) == pytest.approx((3 / 8 / chance - chance) / (1 - chance))
    # A is 1 nowhere in B's first bin and in half of its second: means 0 and 1/2 around 1/4.
    assert correlation_ratio(SMALL) == pytest.approx((1 / 4) ** 2 / (3 / 16))


@pytest.mark.parametrize("alpha", [60.0, 400.0])
def test_renyi_of_high_order_sees_the_likeliest_cells(alpha: float) -> None:
    """The min-entropy -ln(max p) is the limit; with α it is off by α / (α - 1)."""
    expected = (-np.log(3 / 4) - np.log(1 / 2) + np.log(1 / 2)) * alpha / (alpha - 1)
    # Both bins of B are equally likely: Σ p^α is twice the term.
    expected += np.log(2) / (1 - alpha)
    assert renyi_mutual_information(alpha)(SMALL) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("made", [renyi_mutual_information, tsallis_mutual_information])
def test_shannon_is_the_limit(made: object) -> None:
    table = np.random.default_rng(1).uniform(0, 9, (7, 5))
    expected = float(mutual_information(table))
    maker = made
    assert callable(maker)
    for order in (1 - 1e-7, 1 + 1e-7, 1.0):
        assert maker(order)(table) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("rho", [0.0, 0.3, -0.8, 0.95])
def test_gaussian_pairs_in_closed_form(rho: float) -> None:
    """Fine bins: MI and Rényi's at every order are -ln(1 - ρ²) / 2, the correlation ratio is ρ²."""
    step = 0.04
    x = np.arange(-7, 7, step)
    form = (x[:, None] ** 2 - 2 * rho * x[:, None] * x + x**2) / (1 - rho**2)
    table = np.exp(-form / 2)
    information = -np.log(1 - rho**2) / 2
    assert mutual_information(table) == pytest.approx(information, abs=1e-6)
    for alpha in (0.5, 2.0, 3.0):
        assert renyi_mutual_information(alpha)(table) == pytest.approx(information, abs=1e-4)
    assert correlation_ratio(table) == pytest.approx(rho**2, abs=1e-6)
    chance = step / (2 * np.sqrt(np.pi))
    reward = (chance / np.sqrt(1 - rho**2) - chance) / (1 - chance)
    assert cluster_reward(table) == pytest.approx(reward, abs=1e-6)


def test_the_correlation_ratio_knows_functions_of_any_shape() -> None:
    """A is a parabola of B, then B is no function of A."""
    b = np.arange(9)
    table = np.zeros((17, 9))
    table[(b - 4) ** 2, b] = 1
    assert correlation_ratio(table) == pytest.approx(1.0)
    assert correlation_ratio(table.T) == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=80)
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
    assert mutual_information(table) == pytest.approx(information, abs=1e-9)
    assert found == pytest.approx(1 + information / joint, abs=1e-9)
    assert 1 - 1e-9 <= found <= 2 + 1e-9


@each_measure
@settings(max_examples=12)
@given(table=TABLES)
def test_units_order_and_form_of_the_histogram_do_not_matter(name: str, table: np.ndarray) -> None:
    measure: HistogramMeasure = ALL[name]
    found = float(measure(table))
    assert float(measure(table * 0.25)) == pytest.approx(found, rel=1e-9, abs=1e-9)
    # Cells of a sparse table may be given in several parts, and be in any order.
    rows, cols = np.indices(table.shape).reshape(2, -1)
    parts = np.concatenate([table.ravel(), 3 * table.ravel()]) / 4
    sparse = coo_matrix((parts, (np.tile(rows, 2), np.tile(cols, 2))), table.shape)
    assert float(measure(sparse)) == pytest.approx(found, rel=1e-9, abs=1e-9)
    if name != "correlation-ratio":
        assert float(measure(table.T)) == pytest.approx(found, rel=1e-9, abs=1e-9)


@each_measure
def test_many_histograms_at_once(name: str) -> None:
    rng = np.random.default_rng(0)
    tables = rng.uniform(0, 50, (3, 4, 6, 5)).astype(np.float32)
    tables[1, 2] = 0
    found = ALL[name](tables)
    assert found.shape == (3, 4)
    assert found[1, 2] == pytest.approx(nothing(name))
    for i, j in np.ndindex(3, 4):
        alone = ALL[name](tables[i, j].astype(float))
        assert found[i, j] == pytest.approx(float(alone), rel=1e-4, abs=1e-5)
