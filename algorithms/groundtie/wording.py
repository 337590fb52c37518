"""Words, and numbers, in sentences for users."""

from __future__ import annotations


def counted(number: int, noun: str) -> str:
    """Return a number of things in words, as `1 point` or `2 points`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def signed(value: float, digits: int = 2) -> str:
    """Return a number with its sign; one that is rounded to 0 is positive."""
    # Adding 0 turns -0.0 into 0.0.
    return f"{round(value, digits) + 0.0:+.{digits}f}"


def reason_of(error: Exception) -> str:
    """Return why a file cannot be read, by the error of its reader."""
    if isinstance(error, UnicodeDecodeError):
        return "it is no UTF-8 text: save it as UTF-8"
    return str(error)
