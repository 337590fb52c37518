"""All that the rules ask of chips all over a pair: as it is, and without what may deceive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..context import Context
from ..geometry.transform import Transform
from ..similarity.surface import SimilaritySettings
from ..similarity.unexplained import unexplained
from .chips import ChipMatcher
from .locked import Sensors, find_locked_content
from .matcher import MaskOf, Places
from .parts import Part
from .survey import Survey, survey_model, survey_places


@dataclass(frozen=True)
class Rest:
    """What chips show without content that is the same in both arrays.

    Parameters
    ----------
    survey
        What they show; None: it is not asked, as of content that is drawn, and of copies and views
        whose edges do not coincide sharply.
    is_explained
        Whether such content needs no confirmation (see `LockedContent`).
    beyond
        What they show beyond what the reference explains of the input, where it is explained;
        None elsewhere.
    chips
        How many chips there are; of some too little may be left.
    is_evident
        Whether there is more of such content than two views of one ground have in common.
    without_edges
        What they show without the surroundings of edges that coincide, of images in which no such
        content is evident; None: of two radars, and where it is evident.
    """

    survey: Survey | None = None
    is_explained: bool = False
    beyond: Survey | None = None
    chips: int = 0
    is_evident: bool = True
    without_edges: Survey | None = None

    @property
    def is_drawn(self) -> bool:
        """Whether such content is drawn over the images: unexplained, and nothing is asked."""
        return self.survey is None and not self.is_explained


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
    sensors: Sensors | None,
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
        What the images may be; None: one is rendered from heights, and shows nothing drawn.
    open_ground
        Returns which pixels are none, of two radar images; None: it is not asked for.
    context
        Threads and progress.
    """
    model, elsewhere_px = transform.model, accuracy_px[0]
    whole = survey_model(matcher, model, places, elsewhere_px, context.part(0.0, 0.4))
    rest = ground = None
    if sensors is not None:
        part = context.part(0.4, 0.9)
        rest = survey_rest(matcher, transform, places, accuracy_px, sensors, part)
    if open_ground is not None:
        last = context.part(0.9, 1.0)
        ground = survey_model(matcher, model, places, elsewhere_px, last, open_ground)
    return Surveys(whole, rest, ground)


def survey_rest(
    matcher: ChipMatcher,
    transform: Transform,
    places: Places,
    accuracy_px: tuple[float, float],
    sensors: Sensors,
    context: Context,
) -> Rest | None:
    """Return what chips show without content that is the same in both arrays.

    Parameters as `survey_all`.

    Returns
    -------
    None where there is hardly any of such content, unless both images are a radar's: speckle blurs
    it; where the images are one camera's views, which have no more of it than these; and where none
    is looked for.
    """
    pair, asked = matcher.pair, survey_places(matcher.pair.grid)
    elsewhere_px, exact_px = accuracy_px
    locked = find_locked_content(pair, transform, asked, sensors, exact_px, context.quiet())
    is_speckled = sensors is Sensors.RADARS
    if locked is None or not (locked.is_evident or locked.may_be_drawn or is_speckled):
        return None
    # What a mask leaves is little: one measure alone would miss most of it.
    fused, chips = replace(matcher, settings=SimilaritySettings()), len(places.centres)
    # Another input leaves something else of the reference.
    once = replace(context, memo=None)

    def left_without(mask: MaskOf) -> Survey:
        return survey_model(fused, transform.model, places, elsewhere_px, once, mask)

    if not locked.is_evident:
        without_edges = None if is_speckled else left_without(locked.around_edges)
        return Rest(
            left_without(locked), chips=chips, is_evident=False, without_edges=without_edges
        )
    if locked.is_drawn:
        return Rest()
    left = beyond = None
    if not locked.is_explained or locked.sameness.has_sharp_edges:
        left = left_without(locked)
    if locked.is_explained:
        # A copy may be blended into other ground, of which the same windows are no part.
        other = replace(fused, left_of=unexplained)
        beyond = survey_model(other, transform.model, places, elsewhere_px, context)
    return Rest(left, locked.is_explained, beyond, chips)
