"""The pair that the tests of matching share."""

from matching.conftest import executor, other_place, pair, textured

__all__ = ["executor", "other_place", "pair", "textured"]
