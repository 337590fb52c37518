"""The examples of pages print what the pages show, but for numbers."""

from __future__ import annotations

import re
import shlex
from itertools import chain
from pathlib import Path

import pytest

from groundtie.cli import main

DOCS = Path(__file__).resolve().parents[2] / "docs"
# In this order: later ones use files of the first.
PAGES = ("coregister", "register", "warp", "similarity-surface")
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.M | re.S)


def calls(block: str) -> list[tuple[list[str], str]]:
    """Return the commands of an example, each with the output that is shown."""
    parts = re.split(r"^\$ ", block.replace("\\\n", " "), flags=re.M)[1:]
    lines = (part.partition("\n") for part in parts)
    return [(shlex.split(command), shown) for command, _, shown in lines]


def words(text: str) -> list[str]:
    """Return the words of a text; numbers differ between versions of what is installed."""
    return re.findall(r"[^\W\d]+", text)


@pytest.mark.slow
def test_the_examples_print_what_the_pages_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = 0
    for page in PAGES:
        examples = map(calls, BLOCK.findall((DOCS / f"{page}.md").read_text(encoding="utf-8")))
        shown_ones = [example for example in examples if any(shown for _, shown in example)]
        assert shown_ones, page
        for command, shown in chain.from_iterable(shown_ones):
            if command == ["echo", "$?"]:
                assert code == int(shown)
                continue
            code = main(command[1:])
            printed = "".join(capsys.readouterr())
            assert not shown or words(printed) == words(shown), f"{page}: {shlex.join(command)}"
