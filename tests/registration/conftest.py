"""The pairs that the tests of the tools share, and a registration of one of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from contexts import context, one_thread
from textured_pairs import TexturedPair
from tools.conftest import simulated, textured

from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.registration import Registration
from groundtie.registration.specification import Specification

__all__ = ["context", "one_thread", "registration", "simulated", "textured", "wide"]


@pytest.fixture(scope="session")
def registration(textured: TexturedPair) -> Iterator[Registration]:
    """Return an accepted registration; nothing is written."""
    spec = Specification(similarity="orientation", search_radius_m=200.0)
    with Call(textured.reference, textured.input, RegistrationFiles()).register(spec) as found:
        yield found


@pytest.fixture
def wide(registration: Registration) -> Registration:
    """Return the registration as if the images shared only the left half of the grid."""
    evidence = registration.evidence
    assert evidence is not None
    half = evidence.grid.window(0, 0, evidence.grid.width // 2, evidence.grid.height)
    return replace(registration, evidence=replace(evidence, grid=half))
