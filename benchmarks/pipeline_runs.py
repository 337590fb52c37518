"""Registrations by a specification, for comparisons that no tool offers as an option."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from groundtie.context import threads
from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.opening import open_pair
from groundtie.registration.pipeline import run
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


def found_by(
    spec: Specification,
    reference: Any,
    input: Any,
    search_radius: float | None = None,
    workers: int | None = None,
) -> Registration:
    """Return the result, whatever the verdict on it; its rasters are closed.

    Parameters
    ----------
    spec
        Specification of the registration.
    reference, input
        Anything that `open_raster` takes.
    search_radius
        In map units.
    workers
        Number of threads.
    """
    spec = replace(spec, search_radius_m=search_radius)
    with threads(workers) as context, ExitStack() as stack:
        return run(stack.enter_context(open_pair(reference, input, spec, context)), spec, context)
