"""An attempt calls the public function, times it and judges what it gives back."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from benchmark_outcomes import outcome, outcomes

from benchmarks import attempt as attempt_module
from benchmarks.accuracy import CORRECT, CRASHED, INACCURATE, REFUSED, SILENTLY_WRONG
from benchmarks.attempt import Pair, accepted, attempt, count
from benchmarks.cases import RealCase, write_case
from groundtie.errors import NotRegisteredError
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.registration.verdict import Verdict

SHIFT = (7.0, -3.0)

Coregister = Callable[..., Any]


@pytest.fixture
def pair(cases: dict[str, RealCase], tmp_path: Path) -> Pair:
    return write_case(cases["plain"], SHIFT, tmp_path)


@pytest.fixture
def coregister(monkeypatch: pytest.MonkeyPatch) -> Callable[[Coregister], None]:
    """Put a function in the place of `groundtie.coregister`."""

    def put(function: Coregister) -> None:
        monkeypatch.setattr(attempt_module.groundtie, "coregister", function, raising=False)

    return put


def finds(off_px: tuple[float, float]) -> Coregister:
    """Return a coregister that misses the truth by (columns, rows), in reference pixels."""

    def function(reference: Path, input: Path, output: Path, **_: Any) -> SimpleNamespace:
        with rasterio.open(input) as source:
            grid = Grid(source.transform, source.crs, source.width, source.height)
        offset = np.array([[SHIFT[0] + off_px[0], -SHIFT[1] - off_px[1]]])
        model = PolynomialModel("translation", Frame(Affine.identity()), offset)
        return SimpleNamespace(
            verdict=Verdict(True, "fine", check_rmse_px=0.25),
            transform=Transform(model, grid.crs, grid),
        )

    return function


@pytest.mark.parametrize(
    ("off_px", "verdict"),
    [
        ((0.0, 0.0), CORRECT),
        ((2.9, 0.0), CORRECT),  # The truth is known to 2 px.
        ((0.0, 3.5), INACCURATE),
        ((3.0, 5.0), SILENTLY_WRONG),
    ],
)
def test_what_is_accepted_is_compared_with_the_truth(
    pair: Pair,
    coregister: Callable[[Coregister], None],
    off_px: tuple[float, float],
    verdict: str,
) -> None:
    coregister(finds(off_px))
    found = attempt("hills", "sar-optical", pair)
    assert found.error_px == pytest.approx(np.hypot(*off_px), abs=1e-6)
    assert (found.verdict, found.lattice_verdict) == (verdict, verdict)
    assert (found.model, found.reason, found.claimed_rmse_px) == ("translation", "fine", 0.25)
    assert found.sigma_px == 2.0


def test_check_points_and_lattice_are_judged_each_by_itself(
    cases: dict[str, RealCase], tmp_path: Path, coregister: Callable[[Coregister], None]
) -> None:
    coregister(finds((0.0, 0.0)))
    found = attempt("hills", "sar-optical", write_case(cases["hills"], SHIFT, tmp_path))
    assert found.error_px == pytest.approx(0.5)
    assert found.lattice_error_px == pytest.approx(0.0, abs=1e-6)


def test_two_different_places_have_no_right_registration(
    pair: Pair, coregister: Callable[[Coregister], None]
) -> None:
    coregister(finds((0.0, 0.0)))
    found = attempt("hills × plain", "another place", Pair(pair.reference, pair.input))
    assert found.error_px == math.inf
    assert found.verdict == SILENTLY_WRONG


def test_a_refusal_keeps_its_reason(pair: Pair, coregister: Callable[[Coregister], None]) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise NotRegisteredError("a was not registered to b: too few", Verdict(False, "too few"))

    coregister(refuse)
    found = attempt("hills", "sar-optical", pair)
    assert (found.verdict, found.reason, found.model) == (REFUSED, "too few", "")
    assert math.isnan(found.error_px)


def test_a_crash_is_a_finding_of_its_own(
    pair: Pair, coregister: Callable[[Coregister], None], capsys: pytest.CaptureFixture[str]
) -> None:
    def crash(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("by nothing")

    coregister(crash)
    found = attempt("hills", "sar-optical", pair)
    assert (found.verdict, found.lattice_verdict) == (CRASHED, CRASHED)
    assert "by nothing" in found.reason
    assert "Traceback" in capsys.readouterr().err


def test_parameters_and_workers_are_passed_on_and_nothing_else(
    pair: Pair, coregister: Callable[[Coregister], None]
) -> None:
    calls = []

    def listen(*files: Path, **parameters: Any) -> SimpleNamespace:
        calls.append((files, parameters))
        return finds((0.0, 0.0))(*files)

    coregister(listen)
    attempt("hills", "sar-optical", pair, 1, search_radius=29.0)
    ((files, parameters),) = calls
    assert files[:2] == (pair.reference, pair.input)
    assert parameters == {"workers": 1, "search_radius": 29.0}


def test_the_time_of_the_call_is_taken(
    pair: Pair, coregister: Callable[[Coregister], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter([100.0, 102.5])
    monkeypatch.setattr(attempt_module.time, "perf_counter", lambda: next(clock))
    coregister(finds((0.0, 0.0)))
    assert attempt("hills", "sar-optical", pair).seconds == 2.5


def test_the_registered_image_is_thrown_away(
    pair: Pair, coregister: Callable[[Coregister], None]
) -> None:
    written = []

    def write(reference: Path, input: Path, output: Path, **_: Any) -> SimpleNamespace:
        output.write_bytes(b"pixels")
        written.append(output)
        return finds((0.0, 0.0))(reference, input, output)

    coregister(write)
    attempt("hills", "sar-optical", pair)
    assert written and not written[0].exists()


def test_outcomes_are_counted_by_verdict() -> None:
    some = outcomes({CORRECT: 3, REFUSED: 2, CRASHED: 1})
    assert (count(some, CORRECT), count(some, REFUSED), count(some, SILENTLY_WRONG)) == (3, 2, 0)
    assert len(accepted(some)) == 3


def test_outcomes_are_counted_on_the_lattice() -> None:
    some = [outcome(CORRECT, lattice_verdict=INACCURATE), outcome(CORRECT)]
    assert count(some, CORRECT) == 2
    assert count(some, CORRECT, on_lattice=True) == 1


def test_records_are_json() -> None:
    records = [outcome().record(), outcome(REFUSED).record(), outcome(error_px=math.inf).record()]
    assert json.loads(json.dumps(records, allow_nan=False)) == records
    assert [record["error_px"] for record in records] == [0.5, None, None]


def test_lines_say_error_model_and_reason() -> None:
    assert outcome().line() == (
        "hills: correct 0.50 px (affine) in 1.0 s; check points confirm the registration"
    )
    assert outcome(REFUSED).line() == "hills: refused in 1.0 s; no points"
