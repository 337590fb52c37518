"""What users run: one module a tool, with its declaration and the steps in order."""

from __future__ import annotations

import importlib

from ..declaration import Tool, tool_of

# In the order in which they are offered; a tool's function has the name of its module.
NAMES = (
    "register",
    "coregister",
    "match_sar_sar",
    "match_optical",
    "coregister_series",
    "train_feature_classifier",
    "estimate_rotation",
    "warp",
    "extract_gcps",
    "refine_rpc",
    "orthorectify",
    "assess",
    "assess_sensor",
    "similarity_surface",
    "detector_repeatability",
    "filter_speckle",
    "mask_threshold",
    "mask_regions",
    "simulate",
    "simulate_sensor",
)


def load_tool(name: str) -> Tool:
    """Return the declaration of a tool; of all the tools' modules, its own alone is imported."""
    return tool_of(getattr(importlib.import_module(f".{name}", __name__), name))


def load_tools() -> tuple[Tool, ...]:
    """Return the declarations of all tools."""
    return tuple(map(load_tool, NAMES))
