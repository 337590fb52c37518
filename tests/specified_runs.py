"""Registrations that are specified in Python beyond what tools have options for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.registration import Registration
from groundtie.registration.specification import Specification


def register_specified(
    spec: Specification, reference: Path, input: Path, **call: Any
) -> Registration:
    """Register as specified, and write nothing; `call` are further parameters of `Call`."""
    return Call(reference, input, RegistrationFiles(), workers=2, **call).register(spec)
