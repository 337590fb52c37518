"""How a running tool reports its progress and learns that it was cancelled."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from .errors import CancelledError

_LOG = logging.getLogger(__name__)

T = TypeVar("T")


def _ignore(fraction: float, message: str) -> None:
    """Take a report and do nothing with it."""


def _never() -> bool:
    return False


@dataclass(frozen=True)
class Progress:
    """A part of the work, from `start` to `end` of the whole.

    Parameters
    ----------
    report
        Called with the fraction of the whole that is done, 0 to 1, and a message (empty: none).
    is_cancelled
        Asked at every step; when it answers True the work stops with `CancelledError`.
    """

    report: Callable[[float, str], None] = _ignore
    is_cancelled: Callable[[], bool] = _never
    start: float = 0.0
    end: float = 1.0

    def update(self, fraction: float, message: str = "") -> None:
        """Report `fraction` (0 to 1) of this part as done; raise if the work was cancelled."""
        self.check()
        if message:
            _LOG.info(message)
        self.report(self.start + fraction * (self.end - self.start), message)

    def finish(self) -> None:
        """Report this part as done; it is too late to cancel."""
        self.report(self.end, "")

    def over(self, items: Iterable[T], count: int) -> Iterator[T]:
        """Yield `count` items, and report each as done when the next one is asked for."""
        for number, item in enumerate(items, start=1):
            yield item
            self.update(number / count)

    def check(self) -> None:
        """Raise `CancelledError` if the user cancelled the work."""
        if self.is_cancelled():
            raise CancelledError("cancelled; nothing was written")

    def part(self, start: float, end: float) -> Progress:
        """Return the progress of a part of this part, from `start` to `end` (0 to 1)."""
        span = self.end - self.start
        return Progress(
            self.report, self.is_cancelled, self.start + start * span, self.start + end * span
        )


SILENT = Progress()
