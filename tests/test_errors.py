"""The tree of errors: what callers can catch, and the exit codes."""

from __future__ import annotations

import inspect
import pickle

import pytest
from toys import ToyVerdict

from groundtie import errors
from groundtie.errors import GroundTieError, NotRegisteredError

ALL = [
    error
    for _, error in inspect.getmembers(errors, inspect.isclass)
    if issubclass(error, GroundTieError)
]
BUILTINS = {
    "ParameterError": ValueError,
    "RasterOpenError": OSError,
    "BandError": IndexError,
    "OutputError": OSError,
    "NoOverlapError": ValueError,
    "SameFileError": ValueError,
    "NotRegisteredError": RuntimeError,
    "CancelledError": RuntimeError,
}


@pytest.mark.parametrize("error", ALL)
def test_every_error_can_be_caught_as_a_builtin(error: type[GroundTieError]) -> None:
    if error is not GroundTieError:
        assert issubclass(error, (ValueError, OSError, IndexError, RuntimeError, MemoryError))


@pytest.mark.parametrize(("name", "builtin"), BUILTINS.items())
def test_the_builtin_is_the_one_that_a_caller_expects(name: str, builtin: type[Exception]) -> None:
    assert issubclass(getattr(errors, name), builtin)


@pytest.mark.parametrize("error", ALL)
def test_the_message_is_the_text_alone(error: type[GroundTieError]) -> None:
    # KeyError, for one, would print quotation marks around it
    assert str(error("a.tif: no such file")) == "a.tif: no such file"


@pytest.mark.parametrize("error", ALL)
def test_a_message_fits_on_one_line(error: type[GroundTieError]) -> None:
    assert error("GDAL said:\n  no such\tfile ").one_line() == "GDAL said: no such file"


@pytest.mark.parametrize("error", ALL)
def test_exit_codes(error: type[GroundTieError]) -> None:
    assert error.exit_code == (3 if error is NotRegisteredError else 2)


def test_a_refusal_carries_its_verdict() -> None:
    assert NotRegisteredError("refused").verdict is None
    verdict = object()
    assert NotRegisteredError("refused", verdict).verdict is verdict  # type: ignore[arg-type]


def test_a_refusal_is_values_that_json_can_carry() -> None:
    assert NotRegisteredError("refused").summary() == {}
    verdict = ToyVerdict("too few")
    values = {"verdict": verdict.summary()}
    assert NotRegisteredError("refused", verdict).summary() == values  # type: ignore[arg-type]
    error = NotRegisteredError("refused", verdict, ("chips: refused",))  # type: ignore[arg-type]
    assert error.summary() == {**values, "tried": ["chips: refused"]}
    assert pickle.loads(pickle.dumps(error)).tried == ("chips: refused",)
