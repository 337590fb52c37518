"""What users run: one module a tool, with its declaration and the steps in order."""

from __future__ import annotations

import ast
import importlib
import importlib.util
from dataclasses import dataclass

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
    "batch",
    "similarity_surface",
    "detector_repeatability",
    "filter_speckle",
    "mask_surface",
    "mask_threshold",
    "mask_ground",
    "mask_regions",
    "simulate",
    "simulate_sensor",
    "doctor",
)


@dataclass(frozen=True)
class NamedTool:
    """What a list of tools shows of one."""

    name: str
    title: str
    group: str
    summary: str


def load_tool(name: str) -> Tool:
    """Return the declaration of a tool; of all the tools' modules, its own alone is imported."""
    return tool_of(getattr(importlib.import_module(f".{name}", __name__), name))


def named_tool(name: str) -> NamedTool:
    """Return what a list shows of a tool; nothing is imported for it if there is source.

    A list of all tools would otherwise import all that any of them needs.
    """
    spec = importlib.util.find_spec(f".{name}", __name__)
    source = spec.loader.get_source(spec.name) if spec and spec.loader else None  # type: ignore[attr-defined]
    if source is None:
        tool = load_tool(name)
        return NamedTool(name, tool.title, tool.group, tool.summary)
    body = ast.parse(source).body
    function = next(f for f in body if isinstance(f, ast.FunctionDef) and f.name == name)
    (declared,) = (call for call in function.decorator_list if isinstance(call, ast.Call))
    texts = {word.arg: word.value for word in declared.keywords}
    title, group = (ast.literal_eval(texts[key]) for key in ("title", "group"))
    return NamedTool(name, title, group, (ast.get_docstring(function) or "").partition("\n")[0])


def load_tools() -> tuple[Tool, ...]:
    """Return the declarations of all tools."""
    return tuple(map(load_tool, NAMES))
