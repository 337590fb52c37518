"""The pairs that the tests of the tools share."""

from tools.conftest import simulated, textured

__all__ = ["simulated", "textured"]
