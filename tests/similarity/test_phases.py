from __future__ import annotations

import numpy as np
import pytest
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.peak import find_peak
from groundtie.similarity.phases import phase_surface, phases, spectra
from groundtie.similarity.surface import normalise

SIDE, MARGIN = 128, 20


def window(right: int = 0, down: int = 0, gain: float = 1.0) -> Patch:
    """Return a stack with one window of a scene, displaced by whole pixels."""
    canvas = texture(SIDE + 2 * MARGIN, SIDE + 2 * MARGIN, 4)
    inside = canvas[MARGIN - down :, MARGIN - right :][:SIDE, :SIDE]
    return Patch((gain * inside).astype(np.float32)[None], np.ones((1, SIDE, SIDE), bool))


@pytest.mark.parametrize("shift", [(0, 0), (7, -12), (-16, 3)])
@pytest.mark.parametrize("gain", [1.0, 250.0])
def test_phases_agree_on_a_shift_in_any_contrast(shift: tuple[int, int], gain: float) -> None:
    found = phases(spectra(window()), spectra(window(*shift, gain)))
    peak = find_peak(normalise(phase_surface(found, SIDE, 20))[0])
    assert peak.shift_px == pytest.approx(shift, abs=0.1)
    assert peak.height > 20


def test_a_window_without_content_has_no_phases() -> None:
    flat = Patch(np.full((1, SIDE, SIDE), 7, np.float32), np.ones((1, SIDE, SIDE), bool))
    assert not phases(spectra(flat), spectra(window())).any()


def test_what_is_invalid_takes_no_part() -> None:
    drawn = window(7, -12)
    drawn.values[:, 30:60, 40:90] = 1e6
    valid = drawn.values < 1e6
    found = phases(spectra(window()), spectra(Patch(drawn.values, valid)))
    surface = phase_surface(found, SIDE, 20)[0]
    row, col = np.unravel_index(surface.argmax(), surface.shape)
    assert (col - 20, row - 20) == (7, -12)


@pytest.mark.parametrize("side", [64, 65])
def test_no_shift_is_in_the_middle_of_a_surface_of_any_side(side: int) -> None:
    part = Patch(window().values[:, :side, :side], window().valid[:, :side, :side])
    found = phase_surface(phases(spectra(part), spectra(part)), side)
    assert found.shape == (1, 2 * ((side - 1) // 2) + 1, 2 * ((side - 1) // 2) + 1)
    assert np.unravel_index(found[0].argmax(), found[0].shape) == ((side - 1) // 2,) * 2
