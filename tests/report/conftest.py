"""Fixtures of the tests of a report, made in `known_reports`."""

from known_reports import page, pair, ungeoreferenced, variants

__all__ = ["page", "pair", "ungeoreferenced", "variants"]
