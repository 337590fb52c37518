"""Registrations by a specification: what is compared here and is no option of a tool."""

from __future__ import annotations

from pathlib import Path

from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.registered_output import RegisteredOutput
from groundtie.registration.registration import Registration
from groundtie.registration.specification import Specification


def register_specified(
    spec: Specification, reference: Path, input: Path, output: Path, workers: int | None = None
) -> Registration:
    """Register as specified, and write the registered image as tools do by default.

    Raises
    ------
    NotRegisteredError
        The registration was refused.
    """
    files = RegistrationFiles(RegisteredOutput(output, "reference", "cubic"))
    return Call(reference, input, files, workers=workers).register(spec)
