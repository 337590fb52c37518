from __future__ import annotations

import math

import numpy as np
import pytest

from groundtie.errors import ParameterError
from groundtie.simulation.attitude import AttitudeError, AttitudeOptions

SIZE = (801, 601)
CENTRE = np.array([[400.0, 300.0]])


def drawn(seed: int = 1, **options: float) -> AttitudeError:
    none = {"shift_m": 0.0, "drift_px": 0.0, "rotation_deg": 0.0}
    return AttitudeError.draw(AttitudeOptions(**{**none, **options}), SIZE, 2.0, seed)


def test_no_error_leaves_positions_as_they_are() -> None:
    px = np.array([[3.0, 4.0], [700.0, 20.0]])
    np.testing.assert_allclose(drawn()(px), px)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_shift_is_as_long_as_asked_for(seed: int) -> None:
    px = np.array([[0.0, 0.0], [800.0, 600.0]])
    moved = drawn(seed, shift_m=300.0)(px) - px
    np.testing.assert_allclose(np.hypot(*moved.T), 150)
    np.testing.assert_allclose(moved[0], moved[1])


def test_its_direction_is_drawn() -> None:
    moved = [(drawn(seed, shift_m=10.0)(CENTRE) - CENTRE)[0] for seed in range(12)]
    azimuths = np.arctan2(*np.transpose(moved))
    assert np.ptp(azimuths) > math.pi


def test_the_drift_changes_from_line_to_line() -> None:
    error = drawn(drift_px=4.0)
    first, middle, last = (np.array([[123.0, row]]) for row in (-0.5, 300.0, 600.5))
    np.testing.assert_allclose(error(middle), middle)
    change = (error(last) - last) - (error(first) - first)
    assert np.hypot(*change[0]) == pytest.approx(4)


def test_the_rotation_is_about_the_centre() -> None:
    error = drawn(rotation_deg=0.5)
    np.testing.assert_allclose(error(CENTRE), CENTRE)
    moved = error(CENTRE + [[200, 0]]) - CENTRE
    turn = math.radians(0.5)
    np.testing.assert_allclose(moved[0], [200 * math.cos(turn), 200 * math.sin(turn)])


def test_inverse() -> None:
    error = drawn(shift_m=50.0, drift_px=3.0, rotation_deg=0.2)
    px = np.random.default_rng(1).uniform(0, 600, (20, 2))
    np.testing.assert_allclose(error.inverse()(error(px)), px)


@pytest.mark.parametrize("options", [{"shift_m": -1.0}, {"drift_px": -1.0}, {"rotation_deg": 2.0}])
def test_refuses_what_cannot_be(options: dict[str, float]) -> None:
    with pytest.raises(ParameterError):
        AttitudeOptions(**options)
