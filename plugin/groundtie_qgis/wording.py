"""Names of choices and tools in dialogs, in place of the command line's words."""

from __future__ import annotations

import re
from typing import Any

from .choice_labels import label_of
from .tool_loading import named_tools
from .translation import tr


def choice_label(word: str) -> str:
    """Return the label in dialogs for a word of the command line; for a tool's name, its title."""
    titles = {tool.name: tool.title for tool in named_tools()}
    return tr(titles.get(word) or label_of(word))


def in_words(text: str, tool: Any) -> str:
    """Return a help text with tool titles and parameter labels in place of their names.

    Parameters
    ----------
    text
        The text of a declaration.
    tool
        The tool that the text belongs to; None: no tool.
    """
    named = {other.name: tr(other.title) for other in named_tools()}
    parameters = () if tool is None else tool.parameters
    named |= {parameter.name: tr(parameter.kind.label) for parameter in parameters}
    # Short names are also English words, so they are replaced only where the text marks a tool.
    words = (name for name in named if "_" in name or name == "coregister")
    long = "|".join(sorted(words, key=len, reverse=True))
    short = "|".join(sorted(named, key=len, reverse=True))
    pattern = rf"`({short})`|(?:the tool|das Werkzeug) ({short})\b|\b({long})\b"
    return re.sub(pattern, lambda found: f"“{named[next(filter(None, found.groups()))]}”", text)
