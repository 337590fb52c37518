"""Make the pages of docs/ into HTML that the plugin carries and opens without a network."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

_STYLE = """
body { max-width: 60em; margin: 2em auto; padding: 0 1em; font: 16px/1.5 sans-serif; color: #222;
       background: #fff }
h1, h2, h3 { line-height: 1.2 } a { color: #0b5cad } img { max-width: 100% }
table { border-collapse: collapse; display: block; overflow-x: auto }
th, td { border: 1px solid #ccc; padding: .3em .6em; text-align: left; vertical-align: top }
code, pre { background: #f2f2f2; font-size: .9em } code { padding: .1em .25em }
pre { padding: .8em; overflow-x: auto } pre code { padding: 0 }
nav { margin-bottom: 1.5em; font-size: .9em }
@media (prefers-color-scheme: dark) {
  body { color: #ddd; background: #1b1b1b } a { color: #7db7ee } code, pre { background: #2a2a2a }
  th, td { border-color: #555 } img { background: #fff } }
"""
_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{style}</style></head>
<body><nav><a href="index.html">GroundTie</a></nav>
{body}</body></html>
"""


def can_make_pages() -> bool:
    """Whether the package that reads Markdown is there."""
    try:
        import markdown_it  # noqa: F401
    except ImportError:
        return False
    return True


def help_pages(docs: Path) -> dict[str, bytes]:
    """Return the pages of a folder of Markdown and its figures, by their names.

    Links between pages lead from page to page; links to what is not among them are plain text.
    """
    sources = sorted(docs.glob("*.md"))
    names = {path.name for path in sources}
    pages = {
        f"{path.stem}.html": _page(path.read_text(encoding="utf-8"), names).encode()
        for path in sources
    }
    figures = sorted((docs / "figures").glob("*.png"))
    return pages | {f"figures/{path.name}": path.read_bytes() for path in figures}


def _page(text: str, names: set[str]) -> str:
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark").enable("table")
    tokens = parser.parse(re.sub(r"<!--.*?-->\n?", "", text, flags=re.DOTALL))
    title = "GroundTie"
    for before, token in zip([None, *tokens], tokens, strict=False):
        if before is not None and before.type == "heading_open":
            before.attrSet("id", anchor(token.content))
            title = token.content if before.tag == "h1" else title
        if token.children:
            token.children = _with_links(token.children, names)
    body = parser.renderer.render(tokens, parser.options, {})
    return _PAGE.format(title=html.escape(title), style=_STYLE, body=body)


def _with_links(tokens: list[Any], names: set[str]) -> list[Any]:
    """Return the tokens of a line with links to HTML pages, and without those that lead nowhere."""
    kept, dropped = [], 0
    for token in tokens:
        if token.type == "link_open":
            page, mark, place = str(token.attrGet("href")).partition("#")
            if page in names:
                token.attrSet("href", f"{page[:-3]}.html{mark}{place}")
            elif page and not page.startswith("https://"):
                dropped += 1
                continue
        if token.type == "link_close" and dropped:
            dropped -= 1
            continue
        kept.append(token)
    return kept


def anchor(heading: str) -> str:
    """Return the anchor of a heading, as GitHub makes it."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
    return re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
