"""The one list of rules by which registrations are refused.

A rule looks at evidence and returns why it refuses, in a sentence, or None. Its `stage` states
which kind of evidence it reads (see `evidence`); `verdict.judge` asks all rules of the evidence's
stages in their order, and the first one that refuses decides. What may be tried
after that, `is_final` states.

Each stage has a module here, with its limits and their sources. To add a rule, write a function
and put a `Rule` in the tuple of its module. docs/method-verdict.md is made from this list, and a
test asks for evidence that triggers it and evidence that does not.
"""

from __future__ import annotations

from .agreement import AGREEMENT_RULES
from .assessment import ASSESSMENT_RULES
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

RULES: tuple[Rule, ...] = (
    *TIE_POINT_RULES,
    *IMAGES_RULES,
    *SEARCH_RULES,
    *ASSESSMENT_RULES,
    *POSE_RULES,
    *AGREEMENT_RULES,
    *ERROR_RULES,
    *SCENE_RULES,
    *SURVEY_RULES,
    *REFINEMENT_RULES,
    *SERIES_RULES,
)
