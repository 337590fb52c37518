"""All that the rules ask of chips all over a pair: as it is, and without what may deceive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..context import Context
from ..geometry.transform import Transform
from .chips import ChipMatcher
from .locked import Sensors
from .matcher import MaskOf, Places
from .parts import Part
from .rest import Rest, survey_rest
from .survey import Survey, survey_model


@dataclass(frozen=True)
class Surveys:
    """What chips all over a pair show of a transform.

    Parameters
    ----------
    whole
        Of all that takes part; None: they were not asked, nor are the others then.
    rest
        Without content that is the same in both arrays; None: there is none (see `survey_rest`).
    ground
        Of open ground; None: the images are not two radars', or it alone takes part.
    fine
        Of smaller chips, which show smaller parts; None: the others are as small.
    """

    whole: Survey | None = None
    rest: Rest | None = None
    ground: Survey | None = None
    fine: Survey | None = None

    @property
    def parts(self) -> Sequence[Part]:
        """Chips that together match elsewhere, the most evident first."""
        found = [part for one in (self.whole, self.fine) if one is not None for part in one.parts]
        return sorted(found, key=lambda part: part.excess, reverse=True)


def survey_all(
    matcher: ChipMatcher,
    transform: Transform,
    places: Places,
    accuracy_px: tuple[float, float],
    sensors: Sensors,
    open_ground: MaskOf | None,
    context: Context,
) -> Surveys:
    """Match chips all over a pair around a transform, in each way that the rules ask for.

    Parameters
    ----------
    matcher
        What the chips are matched by.
    transform
        What was found.
    places
        The chips, on a regular layout.
    accuracy_px
        Farther than the first from where the transform has all chips lies a second place; within
        the second of whole pixels, it moves the array by these.
    sensors
        What the images may be.
    open_ground
        Returns which pixels are none, of two radar images; None: it is not asked for.
    context
        Threads and progress.
    """
    model, (elsewhere_px, exact_px) = transform.model, accuracy_px
    whole = survey_model(matcher, model, places, elsewhere_px, context.part(0.0, 0.4))
    part = context.part(0.4, 0.9)
    rest = survey_rest(matcher, transform, places, elsewhere_px, sensors, exact_px, part)
    ground = None
    if open_ground is not None:
        last = context.part(0.9, 1.0)
        ground = survey_model(matcher, model, places, elsewhere_px, last, open_ground)
    return Surveys(whole, rest, ground)
