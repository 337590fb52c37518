"""All that the rules ask of chips all over a pair: as it is, and without what may deceive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..context import Context
from ..geometry.transform import Transform
from ..similarity.surface import SimilaritySettings
from .chip_windows import Resampled
from .chips import ChipMatcher
from .locked import find_locked_content
from .matcher import MaskOf, Places
from .parts import Part
from .phase_survey import PHASES_REACH_PX, survey_unexplained
from .shared_content import Sensors, SharedContent
from .survey import Survey, survey_model, survey_places

# Of images that are no two radars' or one camera's, windows that vary alike, and edges that
# coincide, are little of what matches. Without the ones or the others, right transforms leave 1.1
# and more (suite real), what is drawn over other ground mostly up to 0.8.
LEAST_OF_REST = 1.0


@dataclass(frozen=True)
class Rest:
    """What chips show without content that is the same in both arrays.

    Parameters
    ----------
    shared
        That content, however little.
    chips
        How many chips there are; of some too little may be left.
    survey
        What they show; None: it is not asked, as of hardly any such content, of what is drawn, and
        of copies and views that hide nothing.
    without_edges
        What they show without the surroundings of edges that coincide, where no such content is
        evident and hardly anything is left of other images than two radars'; None elsewhere.
    """

    shared: SharedContent
    chips: int
    survey: Survey | None = None
    without_edges: Survey | None = None


@dataclass(frozen=True)
class Surveys:
    """What chips all over a pair show of a transform.

    Parameters
    ----------
    whole
        Of all that takes part; None: they were not asked, nor are the others then.
    rest
        Without content that is the same in both arrays; None: none is looked for.
    ground
        Of open ground; None: the images are not two radars', or it alone takes part.
    fine
        Of smaller chips, which show smaller parts; None: the others are as small.
    unexplained
        Of what the reference does not explain of the input; None: one image is rendered.
    """

    whole: Survey | None = None
    rest: Rest | None = None
    ground: Survey | None = None
    fine: Survey | None = None
    unexplained: Survey | None = None

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
    pair, model, elsewhere_px = matcher.pair, transform.model, accuracy_px[0]
    # Once for all; chips may end a pixel beyond the grid.
    images = Resampled.of(pair, transform, pair.grid, PHASES_REACH_PX + 1, context)
    part = context.part(0.0, 0.4)
    whole = survey_model(matcher, model, places, elsewhere_px, part, images=images)
    rest = ground = unexplained = None
    if sensors is not None:
        part = context.part(0.4, 0.9)
        rest = survey_rest(matcher, transform, places, accuracy_px, sensors, images, part)
        unexplained = survey_unexplained(images, elsewhere_px, context.quiet())
    if open_ground is not None:
        last = context.part(0.9, 1.0)
        ground = survey_model(matcher, model, places, elsewhere_px, last, open_ground, images)
    return Surveys(whole, rest, ground, unexplained=unexplained)


def survey_rest(
    matcher: ChipMatcher,
    transform: Transform,
    places: Places,
    accuracy_px: tuple[float, float],
    sensors: Sensors,
    images: Resampled,
    context: Context,
) -> Rest | None:
    """Return what chips show without content that is the same in both arrays.

    Parameters as `survey_all`, and the images resampled by the transform.

    Returns
    -------
    None where no such content is looked for. Chips are not asked where there is hardly any of it,
    unless both images are a radar's: speckle blurs it; and where the images are one camera's views,
    which have no more of it than these.
    """
    pair, asked = matcher.pair, survey_places(matcher.pair.grid)
    elsewhere_px, exact_px = accuracy_px
    quiet = context.quiet()
    locked = find_locked_content(pair, transform, asked, sensors, exact_px, quiet, images)
    if locked is None:
        return None
    shared, chips = locked.shared, len(places.centres)
    are_radars = sensors is Sensors.RADARS
    if not (shared.is_evident or shared.may_be_drawn or are_radars):
        return Rest(shared, chips)
    # What a mask leaves is little: one measure alone would miss most of it.
    fused = replace(matcher, settings=SimilaritySettings())
    # Another input leaves something else of the reference.
    once = replace(context, memo=None)

    def left_without(mask: MaskOf) -> Survey:
        return survey_model(fused, transform.model, places, elsewhere_px, once, mask, images)

    if not shared.is_evident:
        left = left_without(locked)
        is_low = left.height < LEAST_OF_REST and not are_radars
        without_edges = left_without(locked.around_edges) if is_low else None
        return Rest(shared, chips, left, without_edges=without_edges)
    if shared.is_drawn:
        return Rest(shared, chips)
    is_asked = not shared.is_explained or shared.may_hide_ground
    return Rest(shared, chips, left_without(locked) if is_asked else None)
