from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from textured_pairs import texture
from turned_pairs import patch, turned_pair

from groundtie.pose.pose import Pose
from groundtie.pose.rotation_fields import Field, Template
from groundtie.rasters.patch import Patch


def field_of(seed: int, height: int = 90, width: int = 80) -> Field:
    return Field.of(patch(1000 + 100 * texture(height, width, seed)), 1.0)


def random_directions(seed: int, side: int) -> Field:
    """Return a field of unit length and independent directions, in which there is no trend."""
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi, (side, side))
    return Field(np.stack([np.cos(angle), np.sin(angle)], -1).astype(np.float32), 1.0)


def as_complex(field: Field) -> np.ndarray:
    return field.parts[..., 0] + 1j * field.parts[..., 1]


class TestField:
    @pytest.mark.parametrize(
        ("shape", "pixel"), [((90, 81), 3.0), ((91, 80), 2.5), ((60, 60), 7.0)]
    )
    def test_reduced_images_keep_their_centre(self, shape: tuple[int, int], pixel: float) -> None:
        # A blob in the middle has the same gradients on both sides of it.
        rows, cols = np.indices(shape) - (np.array(shape)[:, None, None] - 1) / 2
        blob = np.exp(-(rows**2 + cols**2) / (2 * (2.5 * pixel) ** 2))
        field = Field.of(patch(100 + 1000 * blob), pixel)
        assert field.shape == (int(shape[0] / pixel), int(shape[1] / pixel))
        energy = field.energy
        np.testing.assert_allclose(energy, energy[::-1, ::-1], atol=0.05 * energy.max())

    def test_images_are_not_enlarged(self) -> None:
        image = patch(1000 + 100 * texture(40, 50))
        field = Field.of(image, 0.4)
        assert field.pixel_px == 1.0
        assert field.shape == (40, 50)

    def test_nothing_is_known_near_masked_pixels(self) -> None:
        valid = np.ones((60, 60), bool)
        valid[:, :20] = False
        field = Field.of(Patch(patch(1000 + texture(60, 60)).values, valid), 1.0)
        assert not field.energy[:, :20].any()
        assert (field.energy[:, 30:] > 0).mean() > 0.99

    def test_the_density_counts_only_where_there_is_energy(self) -> None:
        parts = np.zeros((10, 10, 2), np.float32)
        parts[:5, :, 0] = 2
        assert Field(parts, 1.0).density == pytest.approx(4)
        assert Field(0 * parts, 1.0).density == 0

    def test_an_input_is_seen_where_its_pose_puts_it(self) -> None:
        reference = field_of(0)
        seen = reference.resampled(reference, Pose(shift_px=(3, -2)), 0)
        np.testing.assert_allclose(seen[5:, :-5], reference.parts[3:-2, 3:-2], atol=1e-5)
        bordered = reference.resampled(reference, Pose(), 4)
        np.testing.assert_allclose(bordered[4:-4, 4:-4], reference.parts, atol=1e-5)
        assert not bordered[:3].any()

    def test_directions_turn_by_twice_the_angle(self) -> None:
        image = gaussian_filter(np.random.default_rng(0).normal(size=(81, 81)), 2)
        # `rot90` turns counter-clockwise, as a positive rotation does.
        upright, turned = (Field.of(patch(100 + i), 1.0) for i in (image, np.rot90(image)))
        seen = turned.resampled(upright, Pose(90.0), 0)
        both = np.sum(np.conj(as_complex(upright)) * (seen[..., 0] + 1j * seen[..., 1]))
        assert np.angle(both) == pytest.approx(np.pi, abs=1e-3) or np.angle(both) == pytest.approx(
            -np.pi, abs=1e-3
        )
        surface = Template(upright, 4).surface(turned, Pose(90.0))
        assert np.unravel_index(surface.argmax(), surface.shape) == (4, 4)


class TestTemplate:
    def test_random_directions_have_unit_deviation(self) -> None:
        template = Template(random_directions(0, 96), 16)
        # As large as the search window, so that all overlaps are whole.
        surface = template.surface(random_directions(1, 160), Pose())
        assert surface.shape == (33, 33)
        assert surface.std() == pytest.approx(1, abs=0.1)
        assert surface.mean() == pytest.approx(0, abs=0.15)

    def test_the_same_field_is_as_high_as_its_energy_says(self) -> None:
        field = random_directions(0, 96)
        # Σ |z|² / √(Σ |z|⁴ / 2) for unit lengths, less the mean of some hundred pixels.
        top = Template(field, 8).surface(field, Pose())[8, 8]
        assert top == pytest.approx(np.sqrt(2) * 96, rel=0.02)

    @pytest.mark.parametrize("shift", [(0, 0), (5, -3), (-8, 8)])
    def test_values_are_those_of_the_plain_sums(self, shift: tuple[int, int]) -> None:
        # Of unit length everywhere, so that sums over blocks are exact but for the borders.
        field, other = random_directions(0, 64), random_directions(1, 64)
        other.parts[:, :30] = field.parts[:, :30]
        radius = 8
        surface = Template(field, radius).surface(other, Pose())
        trend = np.stack(
            [gaussian_filter(field.parts[..., i], 8.0, mode="mirror", truncate=4) for i in (0, 1)],
            -1,
        )
        own = np.where(field.energy[..., None] > 0, field.parts - trend, 0)
        padded = np.pad(other.parts, ((radius, radius), (radius, radius), (0, 0)))
        top, left = radius + shift[1], radius + shift[0]
        part = padded[top : top + 64, left : left + 64]
        chance = np.sqrt((field.energy * (part**2).sum(-1)).sum() / 2)
        value = surface[top, left]
        assert value == pytest.approx((own * part).sum() / chance, rel=0.05, abs=0.3)

    def test_the_peak_lies_at_the_shift(self) -> None:
        field = field_of(0, 100, 100)
        rows, cols = slice(13, 93), slice(6, 86)
        part = Field(np.ascontiguousarray(field.parts[rows, cols]), 1.0)
        # What lies at the part's pixel lies 3 px further down and 4 px further left in the whole.
        surface = Template(part, 12).surface(field, Pose())
        row, col = np.unravel_index(surface.argmax(), surface.shape)
        assert (row - 12, col - 12) == (3, -4)

    @pytest.mark.parametrize("shape", [(64, 72), (65, 71)])
    def test_both_ways_are_what_each_way_is(self, shape: tuple[int, int]) -> None:
        template, input = Template(field_of(0, *shape), 10), field_of(1, 80, 77)
        pose = Pose(25.0, 1.1)
        upright, turned = template.surfaces_both_ways(input, pose)
        np.testing.assert_allclose(upright, template.surface(input, pose), atol=1e-3)
        expected = template.surface(input, Pose(205.0, 1.1))
        # The blocks of the energies do not start at the same pixels.
        np.testing.assert_allclose(turned, expected, atol=0.05 * np.abs(expected).max())

    def test_small_overlaps_are_no_better_for_being_small(self) -> None:
        field = random_directions(0, 64)
        corner = np.zeros_like(field.parts)
        corner[:6, :6] = field.parts[:6, :6]
        surface = Template(field, 8).surface(Field(corner, 1.0), Pose())
        # Of 4096 pixels 36 overlap: √2 · 6 alone, but a fifth of all is the least that counts.
        assert surface[8, 8] == pytest.approx(36 / np.sqrt(0.2 * 4096 / 2), rel=0.1)

    def test_an_empty_field_matches_nothing(self) -> None:
        empty = Field(np.zeros((40, 40, 2), np.float32), 1.0)
        assert not Template(field_of(0, 40, 40), 4).surface(empty, Pose()).any()
        assert not Template(empty, 4).surface(field_of(0, 40, 40), Pose()).any()


def test_what_is_turned_matches_at_its_pose_alone() -> None:
    pose = Pose(-35.0, 1.2, (6.0, -4.0))
    reference, input = turned_pair(pose)
    fields = [Field.of(window, pixel) for window, pixel in ((reference, 1.0), (input, 1.2))]
    template = Template(fields[0], 6)
    right = template.surface(fields[1], pose)
    assert np.unravel_index(right.argmax(), right.shape) == (6, 6)
    assert right.max() > 4 * template.surface(fields[1], Pose(35.0, 1.2)).max()
