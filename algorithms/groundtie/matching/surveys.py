"""All surveys of a pair that the rules need: of its full content, and without deceptive parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..context import Context
from ..geometry.transform import Transform
from ..similarity.local_contrast import without_bright, without_dark
from ..similarity.surface import SimilaritySettings
from .chip_windows import PartOf, Resampled
from .chips import ChipMatcher
from .contrast_signs import ContrastSigns, survey_signs
from .far_places import FarSearch
from .locked import find_locked_content
from .matcher import MaskOf, Places
from .parts import MOST_OF_ONE, FarPlace, Part
from .phase_survey import PHASES_REACH_PX, survey_unexplained
from .shared_content import ImageKinds, Sensors, SharedContent
from .stripes import survey_stripes
from .survey import SURVEY_RADIUS_PX, Survey, survey_model, survey_places

# Windows that vary alike and edges that coincide are a small part of what matches on one ground.
# Without one or the other, correct transforms leave 1.1 and more (suite real), drawn content over
# different ground mostly up to 0.8.
LEAST_OF_REST = 1.0

# Where one of both ways alone is evidence: of two radar images, whose speckle hides most of what
# matches, without windows that vary alike and are bright; of two camera images in which hardly
# anything varies alike, without edges. Thin watermarks and bright lines over different grounds
# leave up to 0.3, noisy camera images of one ground 0.6 and more (suite margins, --classes "40 to
# 90 grey levels" "40 to 90 grey levels on the input" "noise and compression" "two dates of one
# camera" "tracks and pins" "cloud deck" "watermark" --seeds 840000-840009 --sample 80).
LEAST_BY_ONE_WAY = 0.5


@dataclass(frozen=True)
class Rest:
    """The survey without the content that is identical in both arrays.

    Parameters
    ----------
    shared
        The identical content, however little.
    chips
        Number of chips, including those of which too little may be left.
    survey
        The survey; None: not made, as there is hardly any such content, or its edges show that it
        is drawn, or the images are copies or views that hide nothing.
    without_edges
        The survey without the surroundings of coinciding edges. It is made where content may be
        drawn without being evident, unless both are radar images: if less than `least` is left, or
        two camera images have hardly any identical content. Else None.
    """

    shared: SharedContent
    chips: int
    survey: Survey | None = None
    without_edges: Survey | None = None

    @property
    def least(self) -> float:
        """The height that the surveys, or the one that is made, should reach."""
        is_by_one_way = self.survey is None or self.shared.sensors is Sensors.RADARS
        return LEAST_BY_ONE_WAY if is_by_one_way else LEAST_OF_REST


@dataclass(frozen=True)
class Surveys:
    """Surveys of a transform by chips all over a pair.

    Parameters
    ----------
    whole
        Of all content that takes part; None: no surveys were made at all.
    rest
        Without the content that is identical in both arrays; None: it is not looked for, because
        one image is rendered, or in the geometry of its sensor.
    ground
        Of two radar images, of open ground, unless it alone takes part; of two camera images,
        without dark pixels, and without bright ones. Else empty.
    fine
        With smaller chips, which show smaller parts; None: the others are as small.
    unexplained
        Of the part of the input that the reference does not explain; None: as `rest`.
    signs
        Signs of the contrast; None: the images are not a radar's and a camera's.
    far
        Where the whole pair matches best beyond the surveys' radius; None: it is not compared,
        because one image is rendered, only ground takes part, or a pose was searched for, which is
        compared with others by itself.
    stripes
        Where the lines of the input that agree least match best; None: one image is rendered.
    """

    whole: Survey | None = None
    rest: Rest | None = None
    ground: Sequence[Survey] = ()
    fine: Survey | None = None
    unexplained: Survey | None = None
    signs: ContrastSigns | None = None
    far: FarPlace | None = None
    stripes: FarPlace | None = None

    @property
    def parts(self) -> Sequence[Part]:
        """Groups of chips that together match elsewhere, the most evident first."""
        found = [part for one in (self.whole, self.fine) if one is not None for part in one.parts]
        return sorted(found, key=lambda part: part.excess, reverse=True)


def survey_all(
    matcher: ChipMatcher,
    transform: Transform,
    places: Places,
    accuracy_px: tuple[float, float],
    kinds: ImageKinds,
    may_repeat: bool,
    context: Context,
) -> Surveys:
    """Match chips all over a pair around a transform, in each way that the rules ask for.

    Parameters
    ----------
    matcher
        Matches the chips.
    transform
        The transform that was found.
    places
        The chips, on a regular layout.
    accuracy_px
        Two limits. A match of all chips farther than the first from the transform's prediction is
        a second place. A transform within the second of whole pixels shifts the array by them.
    kinds
        What the images are.
    may_repeat
        Whether to compare the whole pair beyond the surveys' radius, too.
    context
        Threads and progress.
    """
    pair, elsewhere_px, sensors = matcher.pair, accuracy_px[0], kinds.sensors
    # Resampled once for all surveys; chips may extend a pixel beyond the grid.
    images = Resampled.of(pair, transform, pair.grid, PHASES_REACH_PX + 1, context)
    on_level = images
    if places.grid.pixel_size != pair.grid.pixel_size:
        on_level = matcher.resampled(transform.model, places.grid, SURVEY_RADIUS_PX, context)
    part = context.part(0.0, 0.4)
    search = FarSearch.of(pair, places.grid, transform.model, context.quiet())
    whole = survey_model(matcher, on_level, places, elsewhere_px, part)
    whole = search.with_far(whole, places.chip_px, kinds.open_ground)
    far = search.whole() if may_repeat else None
    signs = survey_signs(on_level, places, context.quiet()) if kinds.may_be_different else None
    rest, unexplained, stripes = None, None, None
    ground: Sequence[Survey] = ()
    if sensors is not None:
        stripes = survey_stripes(pair, places.grid, transform, elsewhere_px, context.quiet())
        part = context.part(0.4, 0.9)
        both = images, on_level
        rest = survey_rest(matcher, transform, places, accuracy_px, kinds, both, part)
        if rest is not None:  # else there is no map layer that the ground could lie beneath
            unexplained = survey_unexplained(images, elsewhere_px, context.quiet())
    last = context.part(0.9, 1.0)
    if sensors is Sensors.RADARS:
        if kinds.open_ground is not None and not kinds.is_masked:
            mask = kinds.open_ground
            ground = [survey_model(matcher, on_level, places, elsewhere_px, last, mask)]
    elif sensors is Sensors.CAMERAS:
        ground = _survey_even_ground(matcher, on_level, places, elsewhere_px, last)
    return Surveys(
        whole, rest, ground, unexplained=unexplained, signs=signs, far=far, stripes=stripes
    )


def _survey_even_ground(
    matcher: ChipMatcher,
    images: Resampled,
    places: Places,
    elsewhere_px: float,
    context: Context,
) -> Sequence[Survey]:
    """Survey a camera pair without dark pixels, as shadows are, and without bright ones, as roofs.

    Shadows fall, and roofs are displaced, to another side at another hour or from another view.
    Parameters as `survey_all` and `survey_model`.
    """
    ways: Sequence[PartOf] = [
        lambda one, other: (without_dark(one), without_dark(other)),
        lambda one, other: (without_bright(one), without_bright(other)),
    ]
    # Masks depend on the place, so descriptions cannot be reused.
    once = replace(context, memo=None)

    def survey(number: int) -> Survey:
        parts = replace(images, part_of=ways[number])
        part = once.part(number / len(ways), (number + 1) / len(ways))
        found = survey_model(matcher, parts, places, elsewhere_px, part)
        # Chips of which scattered pixels are left may be higher than any evidence is.
        return replace(found, surfaces=np.clip(found.surfaces, -MOST_OF_ONE, MOST_OF_ONE))

    return [survey(number) for number in range(len(ways))]


def survey_rest(
    matcher: ChipMatcher,
    transform: Transform,
    places: Places,
    accuracy_px: tuple[float, float],
    kinds: ImageKinds,
    images: tuple[Resampled, Resampled],
    context: Context,
) -> Rest | None:
    """Survey a pair without the content that is identical in both arrays.

    Parameters as `survey_all`, and the images resampled by the transform: on the matching grid, and
    on that of the chips.

    Returns
    -------
    The result; None where no such content is looked for. It has no survey where there is hardly
    any identical content, unless both are radar images, in which speckle blurs it; nor where the
    content is drawn; nor where the images are copies or views that hide nothing.
    """
    if kinds.sensors is None:
        return None
    whole, on_level = images
    elsewhere_px, exact_px = accuracy_px
    asked, quiet = survey_places(matcher.pair.grid), context.quiet()
    locked = find_locked_content(whole, transform, asked, kinds.sensors, exact_px, quiet)
    if locked is None:
        return None
    shared = locked.shared
    are_radars = kinds.sensors is Sensors.RADARS
    # A mask leaves little content, most of which a single measure would miss.
    fused = replace(matcher, settings=SimilaritySettings())
    # The mask of the reference depends on the input, so descriptions cannot be reused.
    once = replace(context, memo=None)

    def left_without(mask: MaskOf) -> Survey:
        return survey_model(fused, on_level, places, elsewhere_px, once, mask)

    rest = Rest(shared, len(places.centres))
    if shared.is_drawn:
        return rest
    if not shared.may_be_drawn:
        is_asked = shared.is_evident and (not shared.is_explained or shared.may_hide_ground)
        return replace(rest, survey=left_without(locked)) if is_asked else rest
    needs_edges = kinds.sensors is Sensors.CAMERAS and not kinds.may_be_different
    if shared.sameness.covers_some or are_radars:
        left = left_without(locked)
        rest = replace(rest, survey=left)
        needs_edges = left.height < rest.least and not are_radars
    if not needs_edges:
        return rest
    return replace(rest, without_edges=left_without(locked.around_edges))
