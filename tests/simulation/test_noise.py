from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from groundtie.simulation.noise import STRIP_ROWS, SmoothNoise, Stream, random_stream, strips


class TestRandomStream:
    def test_same_key_gives_same_numbers(self) -> None:
        first = random_stream(7, Stream.SPECKLE, 3).random(5)
        assert np.array_equal(first, random_stream(7, Stream.SPECKLE, 3).random(5))

    @pytest.mark.parametrize(
        "other",
        [(8, Stream.SPECKLE, 3), (7, Stream.TERRAIN, 3), (7, Stream.SPECKLE, 4)],
        ids=["seed", "stream", "part"],
    )
    def test_every_part_of_the_key_counts(self, other: tuple[int, Stream, int]) -> None:
        first = random_stream(7, Stream.SPECKLE, 3).standard_normal(2000)
        second = random_stream(*other).standard_normal(2000)
        # Independent: the correlation of 2000 pairs has a standard deviation of 0.022.
        assert abs(np.corrcoef(first, second)[0, 1]) < 0.1

    def test_generator_is_the_one_numpy_documents_as_pcg64(self) -> None:
        # Seeding by SeedSequence and PCG64 are covered by numpy's compatibility promise.
        expected = np.random.PCG64(np.random.SeedSequence([5, 1, 0])).random_raw(4)
        got = random_stream(5, Stream.TERRAIN).bit_generator.random_raw(4)
        assert np.array_equal(expected, got)

    def test_streams_have_numbers_of_their_own(self) -> None:
        assert len({int(stream) for stream in Stream}) == len(Stream)


class TestStrips:
    @given(st.integers(1, 5 * STRIP_ROWS))
    def test_every_row_once_and_in_order(self, rows: int) -> None:
        covered = [row for _, start, stop in strips(rows) for row in range(start, stop)]
        assert covered == list(range(rows))

    @given(st.integers(1, 5 * STRIP_ROWS))
    def test_strips_are_numbered_and_bounded(self, rows: int) -> None:
        cut = list(strips(rows))
        assert [index for index, _, _ in cut] == list(range(len(cut)))
        assert all(0 < stop - start <= STRIP_ROWS for _, start, stop in cut)


class TestSmoothNoise:
    @settings(max_examples=25)
    @given(st.integers(1, 59), st.floats(1.0, 40.0))
    def test_strips_join_without_a_seam(self, cut: int, cell_px: float) -> None:
        noise = SmoothNoise.draw((60, 30), cell_px, random_stream(1, Stream.TERRAIN))
        joined = np.concatenate([noise.rows(0, cut), noise.rows(cut, 60)])
        assert np.array_equal(joined, noise.rows(0, 60))

    def test_equals_a_tensor_product_of_cubic_b_splines(self) -> None:
        cell_px = 5.0
        noise = SmoothNoise.draw((20, 25), cell_px, random_stream(3, Stream.TERRAIN))
        knots = np.arange(-3, noise.lattice.shape[0] + 10, dtype=float)
        along_rows = BSpline(knots, _padded(noise.lattice), 3)(np.arange(20) / cell_px)
        knots = np.arange(-3, noise.lattice.shape[1] + 10, dtype=float)
        expected = BSpline(knots, _padded(along_rows.T), 3)(np.arange(25) / cell_px).T
        np.testing.assert_allclose(noise.rows(0, 20), expected, atol=1e-5)

    def test_mean_and_deviation(self) -> None:
        field = SmoothNoise.draw((600, 600), 4.0, random_stream(2, Stream.CROWNS)).rows(0, 600)
        assert field.dtype == np.float32
        assert abs(field.mean()) < 0.05
        assert field.std() == pytest.approx(1.0, abs=0.05)

    def test_correlated_within_a_cell_and_not_beyond_four(self) -> None:
        field = SmoothNoise.draw((400, 400), 8.0, random_stream(2, Stream.CROWNS)).rows(0, 400)
        assert np.corrcoef(field[:, :-1].ravel(), field[:, 1:].ravel())[0, 1] > 0.98
        assert abs(np.corrcoef(field[:, :-40].ravel(), field[:, 40:].ravel())[0, 1]) < 0.1


def _padded(coefficients: np.ndarray) -> np.ndarray:
    """Give scipy as many coefficients as its knots ask for; the added ones are not reached."""
    return np.concatenate([coefficients, np.zeros((9, *coefficients.shape[1:]))])
