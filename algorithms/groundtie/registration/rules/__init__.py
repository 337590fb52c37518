"""The one list of rules by which registrations are refused.

A rule reads evidence and returns why it refuses, in a sentence, or None. Its stage is the kind of
evidence that it reads (see `evidence`). `verdict.refusals` applies all rules of the evidence's
stages in order; the first one that refuses decides. `is_final` states whether anything may be
tried after that.

Each stage has a module here, with its limits and their sources. To add a rule, write a function
and put a `Rule` in the tuple of its module. docs/method-verdict.md is generated from this list. A
test demands evidence that triggers each rule and evidence that does not.
"""

from __future__ import annotations

from collections.abc import Mapping

from .. import evidence
from .agreement import AGREEMENT_RULES
from .assessment import ASSESSMENT_RULES
from .bands import BANDS_RULES
from .error import ERROR_RULES
from .images import IMAGES_RULES
from .pose import POSE_RULES
from .refinement import REFINEMENT_RULES
from .rule import Rule
from .scene import SCENE_RULES
from .search import SEARCH_RULES
from .series import SERIES_RULES
from .survey import SURVEY_RULES
from .tie_points import TIE_POINT_RULES

__all__ = ["RULES", "Rule"]

# By the stage whose evidence they read, in the order in which they are applied.
RULES: Mapping[str, tuple[Rule, ...]] = {
    evidence.TIE_POINTS: TIE_POINT_RULES,
    evidence.BANDS: BANDS_RULES,
    evidence.IMAGES: IMAGES_RULES,
    evidence.SEARCH: SEARCH_RULES,
    evidence.ASSESSMENT: ASSESSMENT_RULES,
    evidence.POSE: POSE_RULES,
    evidence.AGREEMENT: AGREEMENT_RULES,
    evidence.ERROR: ERROR_RULES,
    evidence.SCENE: SCENE_RULES,
    evidence.SURVEY: SURVEY_RULES,
    evidence.REFINEMENT: REFINEMENT_RULES,
    evidence.SERIES: SERIES_RULES,
}
