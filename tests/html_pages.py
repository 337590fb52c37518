"""Read the pages and the data URIs that GroundTie writes."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from html.parser import HTMLParser

import cv2
import numpy as np

# Elements without content.
VOID = {"meta", "img", "input", "br", "link", "hr", "path", "circle"}


@dataclass
class Element:
    """One element of a page with its own text and that of its children."""

    tag: str
    attributes: dict[str, str | None]
    text: str = ""


@dataclass
class Page(HTMLParser):
    """A page as a list of elements; refuses tags that do not nest."""

    source: str
    elements: list[Element] = field(default_factory=list)
    open_elements: list[Element] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.source)
        self.close()
        assert not self.open_elements

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(dict(attrs)) == len(attrs), f"an attribute of {tag} is there twice"
        self.elements.append(Element(tag, dict(attrs)))
        if tag not in VOID:
            self.open_elements.append(self.elements[-1])

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(Element(tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open_elements.pop().tag == tag

    def handle_data(self, data: str) -> None:
        for element in self.open_elements:
            element.text += data

    def all(self, *tags: str) -> list[Element]:
        return [element for element in self.elements if element.tag in tags]

    @property
    def text(self) -> str:
        return " ".join(self.all("main")[0].text.split())

    @property
    def numbers(self) -> dict[str, str]:
        """The terms of the verdict's list and what they are."""
        names, values = self.all("dt"), self.all("dd")
        return {n.text: " ".join(v.text.split()) for n, v in zip(names, values, strict=True)}


def decoded(uri: str, kind: str) -> bytes:
    head, data = uri.split(",")
    assert head == f"data:{kind};base64"
    return base64.b64decode(data, validate=True)


def picture_of(uri: str, kind: str) -> np.ndarray:
    data = np.frombuffer(decoded(uri, kind), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
