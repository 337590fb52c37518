"""Chips that agree with each other on another place than a model has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Expected false alarms (log10) below which chance does not explain a part, and how many chips of it
# must disagree for each that confirms the model. Measured by the suites real and attacks: parts of
# true transforms have -1.1 at least; where towns' layover has less, every third chip confirms.
LOG10_FALSE_ALARMS = -2.0
LEAST_PROPORTION = 2

# The same of chips that need not be neighbours: true transforms have -2.9 at least, between clouds;
# strips at an angle and drawings -4.0 at most.
LOG10_FALSE_ALARMS_ALL_OVER = -3.5


@dataclass(frozen=True)
class Part:
    """Neighbouring chips that agree with each other on another place than the model has.

    Parameters
    ----------
    where
        In which part of the grid they lie, such as "upper left".
    shift_px
        By how much they lie elsewhere, (x, y) in pixels of the grid.
    chips
        How many they are.
    surrounded
        How many chips lie in their convex hull, they included.
    confirming
        How many of those agree with the model.
    log10_false_alarms
        log10 of the expected number of such parts if all chips but these agreed by chance.
    members
        Which chips of the survey they are, by number.
    """

    where: str
    shift_px: tuple[float, float]
    chips: int
    surrounded: int
    confirming: int
    log10_false_alarms: float
    members: tuple[int, ...] = ()

    @property
    def distance_px(self) -> float:
        """How far off they lie."""
        return float(np.hypot(*self.shift_px))

    @property
    def is_evident(self) -> bool:
        """Whether chance does not explain it, and the model hardly holds among its chips."""
        evident = self.log10_false_alarms <= LOG10_FALSE_ALARMS
        return evident and self.chips >= LEAST_PROPORTION * self.confirming


@dataclass(frozen=True)
class Elsewhere:
    """Chips all over that agree with each other on another place than the model has.

    Parameters
    ----------
    shift_px
        By how much they lie elsewhere, (x, y) in pixels of the grid.
    chips
        How many they are.
    log10_false_alarms
        log10 of the expected number of such places if all chips agreed by chance.
    """

    shift_px: tuple[float, float]
    chips: int
    log10_false_alarms: float

    @property
    def is_evident(self) -> bool:
        """Whether chance does not explain it."""
        return self.log10_false_alarms <= LOG10_FALSE_ALARMS_ALL_OVER
