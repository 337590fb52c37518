"""What users run: one file a tool, each with its declaration and the steps in order."""

from __future__ import annotations

from ..declaration import tool_of
from .assess import assess
from .coregister import coregister
from .simulate import simulate
from .warp import warp

TOOLS = tuple(tool_of(function) for function in (coregister, warp, assess, simulate))
