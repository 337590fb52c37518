"""The plugin carries its documentation: pages whose links and pictures are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from groundtie.tools import NAMES

pytest.importorskip("tomllib", reason="the build needs Python 3.11")
pytest.importorskip("markdown_it")
from scripts import build_plugin
from scripts.help_pages import help_pages, main

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def pages() -> dict[str, bytes]:
    return help_pages(DOCS)


@pytest.mark.slow
def test_every_tool_has_its_page_with_its_parameters(pages: dict[str, bytes]) -> None:
    for name in NAMES:
        page = pages[f"{name.replace('_', '-')}.html"].decode()
        assert "<h1 id=" in page
        assert "<table>" in page
        assert "<!--" not in page


def test_every_link_and_picture_is_there(pages: dict[str, bytes]) -> None:
    for name, data in pages.items():
        if not name.endswith(".html"):
            continue
        page = data.decode()
        for picture in re.findall(r'<img src="([^"]+)"', page):
            assert picture in pages
        for link in re.findall(r'<a href="([^"]+)"', page):
            if link.startswith("https://"):
                continue
            target, _, anchor = link.partition("#")
            assert target == "" or target in pages, (name, link)
            assert not anchor or f'id="{anchor}"' in pages[target or name].decode(), (name, link)


def test_no_page_leads_to_a_placeholder_or_loads_from_the_network(pages: dict[str, bytes]) -> None:
    text = b"".join(data for name, data in pages.items() if name.endswith(".html")).decode()
    assert not re.search(r'href="[^"]*example\.', text)
    assert not re.search(r"<script|<link|src=\"https?:", text)


@pytest.fixture
def docs(tmp_path: Path) -> Path:
    """A folder of two pages and an index, beside a file that is no page."""
    folder = tmp_path / "docs"
    folder.mkdir()
    (tmp_path / "LICENSE").touch()
    (tmp_path / "README.md").write_text("# Read me\n\n[a](docs/a.md)\n")
    (folder / "index.md").write_text(
        "# I\n\n## Start\n\n* [A page](a.md)\n* [B](b.md), [A](a.md)\n"
    )
    (folder / "a.md").write_text(
        "# A & B\n\n[out](../LICENSE), [in](b.md#c), [web](https://doi.org/1), [up](../README.md)\n"
    )
    (folder / "b.md").write_text("# B\n\n## C\n")
    return folder


def test_links_to_what_is_not_shipped_are_plain_text(docs: Path) -> None:
    pages = help_pages(docs)
    page = pages["a.html"].decode()
    assert "out, " in page
    assert '<a href="readme.html">up</a>' in page
    assert '<a href="a.html">a</a>' in pages["readme.html"].decode()
    assert '<a href="b.html#c">in</a>' in page
    assert '<a href="https://doi.org/1">web</a>' in page
    assert "<title>A &amp; B</title>" in page


def test_every_page_has_the_navigation_with_its_own_place(docs: Path) -> None:
    page = help_pages(docs)["b.html"].decode()
    assert '<details open><summary>Start</summary><ul><li><a href="a.html">A page</a></li>' in page
    assert '<a href="b.html" aria-current=page>B</a>' in page
    assert page.count("<li>") == 2


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[x](nowhere.md)", "no such page or heading: nowhere.md"),
        ("[x](a.md#nowhere)", "no such page or heading: a.html#nowhere"),
        ("[x](../nowhere/LICENSE)", "no such page or heading: ../nowhere/LICENSE"),
        ("[x](#nowhere)", "no such page or heading: b.html#nowhere"),
    ],
)
def test_a_broken_link_ends_the_build(docs: Path, text: str, fault: str) -> None:
    (docs / "b.md").write_text(f"# B\n\n## C\n\n{text}\n")
    with pytest.raises(ValueError, match=f"b.md: {re.escape(fault)}$"):
        help_pages(docs)


def test_a_page_that_nobody_finds_ends_the_build(docs: Path) -> None:
    (docs / "c.md").write_text("# C\n")
    with pytest.raises(ValueError, match=r"c\.md: not named by index\.md"):
        help_pages(docs)


def test_the_site_is_the_same_files(
    pages: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["help_pages.py", str(tmp_path / "site")])
    assert main() == 0
    written = {path for path in (tmp_path / "site").rglob("*") if path.is_file()}
    names = {path.relative_to(tmp_path / "site").as_posix(): path for path in written}
    assert {name: path.read_bytes() for name, path in names.items()} == pages


def test_a_placeholder_is_not_released(tmp_path: Path) -> None:
    metadata = tmp_path / "metadata.txt"
    links = dict.fromkeys(("homepage", "tracker", "repository"), "https://groundtie.test/x")
    lines = ["[general]", "email=us@groundtie.test", *(f"{k}={v}" for k, v in links.items())]
    metadata.write_text("\n".join(lines))
    assert build_plugin.obstacles(tmp_path) == []
    metadata.write_text(
        "\n".join(lines).replace("tracker=https://groundtie.test", "tracker=https://example.org")
    )
    assert build_plugin.obstacles(tmp_path) == [
        "metadata.txt: tracker is a placeholder: https://example.org/x"
    ]


def test_what_is_no_release_is_called_experimental() -> None:
    metadata = (ROOT / "metadata.txt").read_text(encoding="utf-8")
    assert not build_plugin.obstacles(ROOT) or "experimental=True" in metadata.splitlines()


def test_a_release_zip_is_refused_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(build_plugin, "obstacles", lambda root: ["metadata.txt: a placeholder"])
    target = tmp_path / "plugin.zip"
    monkeypatch.setattr("sys.argv", ["build_plugin.py", "--release", str(target)])
    assert build_plugin.main() == 1
    assert "a placeholder" in capsys.readouterr().err
    assert not target.exists()
