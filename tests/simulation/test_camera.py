"""The push-broom camera: both directions agree, and the image is what a flight would give."""

from __future__ import annotations

import math

import numpy as np
import pytest

from groundtie.simulation.camera import PushBroom

TARGET = (1000.0, 2000.0, 450.0)
SIZE = (801, 601)
CENTRE = np.array([400.0, 300.0])


def camera(
    azimuth_deg: float = 250.0,
    off_nadir_deg: float = 20.0,
    heading_deg: float = 193.0,
    pixel_m: float = 1.0,
    altitude_m: float = 681_000.0,
) -> PushBroom:
    return PushBroom.aimed(
        TARGET, SIZE, pixel_m, azimuth_deg, off_nadir_deg, heading_deg, altitude_m
    )


@pytest.mark.parametrize("azimuth_deg", [0.0, 100.0, 283.0])
@pytest.mark.parametrize("off_nadir_deg", [0.0, 15.0, 40.0])
class TestBothDirections:
    def test_there_and_back(self, azimuth_deg: float, off_nadir_deg: float) -> None:
        generator = np.random.default_rng(1)
        px = generator.uniform(0, 800, (200, 2))
        height = generator.uniform(200, 900, 200)
        made = camera(azimuth_deg, off_nadir_deg)
        ground = np.column_stack([made.localise(px, height), height])
        np.testing.assert_allclose(made.project(ground), px, atol=1e-6)

    def test_collinearity(self, azimuth_deg: float, off_nadir_deg: float) -> None:
        """Ground, perspective centre of the line and detector are on one ray."""
        made = camera(azimuth_deg, off_nadir_deg)
        ground = np.array([[1210.0, 1890.0, 700.0], [830.0, 2220.0, 300.0]])
        column, line = (made.project(ground) - CENTRE).T
        centre = made.position_m + line[:, None] * made.step_m
        detector = made.focal_px * made.view + column[:, None] * made.across
        rays = (ground - centre) / np.linalg.norm(ground - centre, axis=1)[:, None]
        np.testing.assert_allclose(
            rays, detector / np.linalg.norm(detector, axis=1)[:, None], atol=1e-12
        )

    def test_the_centre_shows_the_target(self, azimuth_deg: float, off_nadir_deg: float) -> None:
        made = camera(azimuth_deg, off_nadir_deg)
        np.testing.assert_allclose(made.project(np.array([TARGET]))[0], CENTRE, atol=1e-9)

    def test_high_things_lean_away_from_the_camera(
        self, azimuth_deg: float, off_nadir_deg: float
    ) -> None:
        """The ray through something h above the target meets the ground h · tan ν behind it."""
        made = camera(azimuth_deg, off_nadir_deg)
        top = np.array([[*TARGET[:2], TARGET[2] + 50]])
        met = made.localise(made.project(top), TARGET[2])[0]
        azimuth = math.radians(azimuth_deg)
        lean = 50 * math.tan(math.radians(off_nadir_deg))
        away = np.array([math.sin(azimuth), math.cos(azimuth)]) * lean
        # Over 42 m, the line of sight of 681 km turns by 0.06 mrad.
        np.testing.assert_allclose(met, np.array(TARGET[:2]) - away, atol=5e-3)


class TestGround:
    def test_from_above_it_is_a_map_of_its_pixel_size(self) -> None:
        """Flying north, lines run north and columns west: turned by 180°, not mirrored."""
        made = camera(off_nadir_deg=0.0, heading_deg=0.0, pixel_m=0.5)
        xy = made.localise(CENTRE + [[0, 0], [100, 0], [0, 100]], TARGET[2]) - TARGET[:2]
        np.testing.assert_allclose(xy, [[0, 0], [-50, 0], [0, 50]], atol=1e-6)

    @pytest.mark.parametrize("heading_deg", [10.0, 193.0, 350.0])
    def test_it_is_never_mirrored(self, heading_deg: float) -> None:
        made = camera(heading_deg=heading_deg)
        xy = made.localise(CENTRE + [[0, 0], [1, 0], [0, 1]], TARGET[2])
        along_columns, along_rows = xy[1:] - xy[0]
        # On the map y runs up, in the image rows run down.
        assert np.cross([*along_columns, 0], [*along_rows, 0])[2] < 0

    def test_lines_follow_the_flight(self) -> None:
        made = camera(heading_deg=30.0, pixel_m=2.0)
        xy = made.localise(CENTRE + [[0, 0], [0, 10]], TARGET[2])
        heading = math.radians(30)
        np.testing.assert_allclose(
            xy[1] - xy[0], [20 * math.sin(heading), 20 * math.cos(heading)], atol=1e-6
        )

    def test_detectors_spread_on_the_ground_by_the_look_to_the_side(self) -> None:
        """Looking across the flight at ν, a detector covers pixel / cos ν."""
        made = camera(azimuth_deg=90.0, off_nadir_deg=30.0, heading_deg=0.0)
        xy = made.localise(CENTRE + [[-0.5, 0], [0.5, 0]], TARGET[2])
        assert math.dist(*xy) == pytest.approx(1 / math.cos(math.radians(30)), rel=1e-6)

    def test_columns_are_a_perspective(self) -> None:
        """Across, a rise towards the camera enlarges by altitude over distance; along, nothing."""
        made = camera(off_nadir_deg=0.0, heading_deg=0.0, altitude_m=10_000.0)
        ground = np.array([[1100.0, 2100.0, 450.0], [1100.0, 2100.0, 1450.0]])
        low, high = made.project(ground) - CENTRE
        assert high[0] / low[0] == pytest.approx(10 / 9)
        assert high[1] == pytest.approx(low[1])
