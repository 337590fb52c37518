"""What chips show without content that is the same in both arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..context import Context
from ..geometry.transform import Transform
from ..similarity.surface import SimilaritySettings
from .chips import ChipMatcher
from .locked import LockedContent, find_offset
from .matcher import Places
from .parts import LEAST_PROPORTION
from .survey import Survey, survey_model, survey_places

# Nothing makes ground lie at whole pixels of both arrays. A transform, or many chips that confirm
# it, within this distance of such an offset matches what is drawn, or ground that lies there by
# chance. Suite attacks, seeds 40 to 47 and 64 to 66: transforms of ground from 0.2 px on, but for
# one in five; what is drawn mostly below. Two sensors' chips up to 0.38; of drawn content that a
# mask misses, as it has other colours, from 0.48 on.
_WHOLE_PX, LARGEST_WHOLE_SHARE = 0.25, 0.4


@dataclass(frozen=True)
class Rest:
    """Where chips match without content that is the same in both arrays.

    Parameters
    ----------
    survey
        What they show.
    is_explained
        Whether such content needs no confirmation (see `Sameness.is_explained`).
    whole_share
        How many of the chips that confirm the model lie at whole pixels of both arrays.
    """

    survey: Survey
    is_explained: bool = False
    whole_share: float = 0.0

    @property
    def is_confirming(self) -> bool:
        """Whether the rest confirms the model, or does not contradict it where that is enough."""
        survey = self.survey
        elsewhere = survey.elsewhere
        if self.is_explained:
            is_more = elsewhere.chips >= LEAST_PROPORTION * survey.confirming
            return not (elsewhere.is_evident and is_more)
        is_one_place = survey.height > survey.rival_height and not elsewhere.is_evident
        return survey.is_confirming and is_one_place and not self.is_whole

    @property
    def is_whole(self) -> bool:
        """Whether what is left still matches at whole pixels, as what is drawn does."""
        return self.whole_share >= LARGEST_WHOLE_SHARE


def survey_rest(
    matcher: ChipMatcher,
    transform: Transform,
    survey: Survey,
    places: Places,
    context: Context,
) -> Rest | None:
    """Return what chips show without content that is the same in both arrays.

    None where neither the transform nor the chips lie at whole pixels of the arrays.

    Parameters
    ----------
    matcher
        What the chips are matched by.
    transform
        What was found.
    survey
        What the chips show with all content.
    places
        The chips.
    context
        Threads and progress.
    """
    pair = matcher.pair
    offset = find_offset(pair, transform)
    if offset is None:
        return None
    locked = LockedContent(pair, offset.px)
    is_whole = _whole_share(survey, locked, transform) >= LARGEST_WHOLE_SHARE
    if not is_whole and offset.bend_px > _WHOLE_PX:
        return None
    is_explained = locked.sameness(survey_places(pair.grid), context.quiet()).is_explained
    # What a mask leaves is little: one measure alone would miss most of it.
    fused = replace(matcher, settings=SimilaritySettings())
    rest = survey_model(fused, transform.model, context, locked, places, survey.elsewhere_px)
    return Rest(rest, is_explained, _whole_share(rest, locked, transform))


def _whole_share(survey: Survey, locked: LockedContent, transform: Transform) -> float:
    """Return how many of the confirming chips match at an offset of whole pixels."""
    grid, reference = survey.grid, locked.pair.reference.source.grid
    px = survey.centres[survey.is_confirming_chip].astype(float)
    if len(px) == 0:
        return 0.0
    matched = px + survey.shifts_px[survey.is_confirming_chip]
    own = reference.map_to_pixel(grid.pixel_to_map(px))
    off = transform(grid.pixel_to_map(matched)) - own - locked.offset_px
    within = _WHOLE_PX * grid.pixel_size_m / reference.pixel_size_m
    return float(np.mean(np.hypot(*off.T) <= within))
