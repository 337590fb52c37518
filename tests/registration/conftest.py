"""The pairs that the tests of the tools share, and a registration of one of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from textured_pairs import TexturedPair
from tools.conftest import simulated, textured

from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.registration import Registration
from groundtie.registration.specification import Specification

__all__ = ["registration", "simulated", "textured"]


@pytest.fixture(scope="session")
def registration(textured: TexturedPair) -> Iterator[Registration]:
    """Return an accepted registration; nothing is written."""
    spec = Specification(similarity="orientation", search_radius_m=200.0)
    with Call(textured.reference, textured.input, RegistrationFiles()).register(spec) as found:
        yield found
