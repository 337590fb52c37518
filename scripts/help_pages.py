"""Make the pages of docs/ into HTML: the help that the plugin carries, and the site (`make docs`).

Both are the same files. They load nothing from the network; a link that leads nowhere, and a page
that docs/index.md does not name, are errors.
"""

from __future__ import annotations

import argparse
import html
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
_STYLE = """
body { max-width: 78em; margin: 0 auto; padding: 0 1em; font: 16px/1.5 sans-serif; color: #222;
       background: #fff; display: grid; grid-template-columns: 14em minmax(0, 1fr); gap: 2.5em }
main { max-width: 56em; padding: 1em 0 4em } h1, h2, h3 { line-height: 1.2 }
a { color: #0b5cad } img { max-width: 100% }
table { border-collapse: collapse; display: block; overflow-x: auto }
th, td { border: 1px solid #ccc; padding: .3em .6em; text-align: left; vertical-align: top }
code, pre { background: #f2f2f2; font-size: .9em } code { padding: .1em .25em }
pre { padding: .8em; overflow-x: auto } pre code { padding: 0 }
nav { font-size: .9em; padding: 1.5em 0; position: sticky; top: 0; max-height: 100vh;
      overflow-y: auto; box-sizing: border-box }
nav ul { list-style: none; margin: .2em 0 .8em; padding-left: .8em } nav summary { cursor: pointer }
nav a { text-decoration: none } nav [aria-current] { font-weight: bold; color: inherit }
@media (max-width: 50em) { body { display: block } nav { position: static; max-height: none } }
@media (prefers-color-scheme: dark) {
  body { color: #ddd; background: #1b1b1b } a { color: #7db7ee } code, pre { background: #2a2a2a }
  th, td { border-color: #555 } img { background: #fff } }
"""
_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>{style}</style></head>
<body><nav><a href="index.html">GroundTie</a>
{navigation}</nav>
<main>
{body}</main></body></html>
"""


@dataclass(frozen=True)
class Page:
    """A page: its file, title, heading anchors, links and content."""

    source: Path
    title: str
    anchors: frozenset[str]
    links: tuple[str, ...]
    body: str


def can_make_pages() -> bool:
    """Whether the Markdown package is installed."""
    try:
        import markdown_it  # noqa: F401
    except ImportError:
        return False
    return True


def help_pages(docs: Path) -> dict[str, bytes]:
    """Return the pages of a Markdown folder and its parent's README, and its figures, by name.

    Links between pages are kept; links to other files of the repository become plain text.

    Raises
    ------
    ValueError
        Links are broken, or pages are not in the navigation.
    """
    sources = {path.resolve(): f"{path.stem}.html" for path in sorted(docs.glob("*.md"))}
    readme = (docs.parent / "README.md").resolve()
    if readme.is_file():
        sources[readme] = "readme.html"
    pages = {name: _page(path, sources) for path, name in sources.items()}
    sections = _sections(docs / "index.md")
    if faults := [*_broken_links(pages), *_unnamed(pages, sections)]:
        raise ValueError("\n".join(faults))
    made = {
        name: _PAGE.format(
            title=html.escape(page.title),
            style=_STYLE,
            navigation=_navigation(sections, name),
            body=page.body,
        ).encode()
        for name, page in pages.items()
    }
    figures = sorted((docs / "figures").glob("*.png"))
    return made | {f"figures/{path.name}": path.read_bytes() for path in figures}


def _page(source: Path, sources: dict[Path, str]) -> Page:
    from markdown_it import MarkdownIt

    text = source.read_text(encoding="utf-8")
    parser = MarkdownIt("commonmark").enable("table")
    tokens = parser.parse(re.sub(r"<!--.*?-->\n?", "", text, flags=re.DOTALL))
    title = "GroundTie"
    anchors: list[str] = []
    links: list[str] = []
    for before, token in zip([None, *tokens], tokens, strict=False):
        if before is not None and before.type == "heading_open":
            anchors.append(anchor(token.content))
            before.attrSet("id", anchors[-1])
            title = token.content if before.tag == "h1" else title
        if token.children:
            token.children = _with_links(token.children, source, sources, links)
    body = parser.renderer.render(tokens, parser.options, {})
    return Page(source, title, frozenset(anchors), tuple(links), body)


def _with_links(
    tokens: list[Any], source: Path, sources: dict[Path, str], links: list[str]
) -> list[Any]:
    """Return the tokens of a line with links to pages, and without links to other files.

    Targets among the pages, and missing files, are added to `links`.
    """
    kept, dropped = [], 0
    for token in tokens:
        if token.type == "link_open":
            path, mark, place = str(token.attrGet("href")).partition("#")
            target = Path(os.path.normpath(source.parent / path))
            page = sources[source] if not path else sources.get(target)
            if page is not None:
                token.attrSet("href", f"{page if path else ''}{mark}{place}")
                links.append(f"{page}{mark}{place}")
            elif not path.startswith("https://"):
                links += [] if target.exists() else [path]
                dropped += 1
                continue
        if token.type == "link_close" and dropped:
            dropped -= 1
            continue
        kept.append(token)
    return kept


def _broken_links(pages: dict[str, Page]) -> list[str]:
    """Return a line for each broken link."""
    faults = []
    for page in pages.values():
        for link in page.links:
            name, _, place = link.partition("#")
            if name not in pages or (place and place not in pages[name].anchors):
                faults.append(f"{page.source}: no such page or heading: {link}")
    return faults


def _sections(index: Path) -> dict[str, dict[str, str]]:
    """Return the navigation: for each section of the index, page titles by page names."""
    sections: dict[str, dict[str, str]] = {}
    for part in index.read_text(encoding="utf-8").split("\n## ")[1:]:
        heading, _, text = part.partition("\n")
        links = sections.setdefault(heading, {})
        for title, name in re.findall(r"\[([^\]]+)\]\(([\w-]+)\.md\)", text):
            links.setdefault(f"{name}.html", title)
    return sections


def _unnamed(pages: dict[str, Page], sections: dict[str, dict[str, str]]) -> list[str]:
    named = {name for links in sections.values() for name in links}
    left = [page.source for name, page in pages.items() if name not in named]
    return [f"{p}: not named by index.md" for p in left if p.name not in ("index.md", "README.md")]


def _navigation(sections: dict[str, dict[str, str]], current: str) -> str:
    parts = []
    for heading, links in sections.items():
        items = [
            f'<li><a href="{name}"{" aria-current=page" if name == current else ""}>'
            f"{html.escape(title)}</a></li>"
            for name, title in links.items()
        ]
        shown = " open" if current in links or current == "index.html" else ""
        summary = f"<summary>{html.escape(heading)}</summary>"
        parts.append(f"<details{shown}>{summary}<ul>{''.join(items)}</ul></details>")
    return "\n".join(parts)


def anchor(heading: str) -> str:
    """Return the anchor of a heading, as GitHub makes it."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
    return re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the site goes")
    folder = parser.parse_args().folder
    for name, data in help_pages(ROOT / "docs").items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    print(folder / "index.html")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
