"""Outcomes of registrations that never took place."""

from __future__ import annotations

from typing import Any

from benchmarks.accuracy import CORRECT, CRASHED, REFUSED
from benchmarks.attempt import Outcome, Try


def outcome(verdict: str = CORRECT, error_px: float = 0.5, **more: Any) -> Outcome:
    """Return an outcome; what is not said is as for a good registration."""
    if verdict in (REFUSED, CRASHED):
        name, group = more.pop("name", "hills"), more.pop("group", "sar-optical")
        return Try(None, verdict, "no points", 1.0).unregistered(name, group, 0.0)
    values = {
        "name": "hills",
        "group": "sar-optical",
        "verdict": verdict,
        "lattice_verdict": verdict,
        "error_px": error_px,
        "lattice_error_px": error_px,
        "sigma_px": 0.0,
        "seconds": 1.0,
        "claimed_rmse_px": 0.4,
        "model": "affine",
        "reason": "check points confirm the registration",
    }
    return Outcome(**{**values, **more})


def outcomes(counts: dict[str, int], **more: Any) -> list[Outcome]:
    """Return so many outcomes of each verdict."""
    return [outcome(verdict, **more) for verdict, count in counts.items() for _ in range(count)]
