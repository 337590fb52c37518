"""Pairs among the real ones that were once accepted and should not have been."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..cases import SAR_OPTICAL, read_image
from .catalogue import EXAMPLES, Attack
from .noise import untouched
from .pairs import Pair, Source, pixels
from .scenes import Scene, to_grey

FOLDER = "attacks"

# The kind of the pair, and the true displacement of the ground (right, down) in pixels. None:
# another place, or parts that moved differently, so that no transform may be accepted.
_OPTICAL = "optical-optical"
_KNOWN: dict[str, tuple[str, tuple[float, float] | None]] = {
    "caption-strip-different-places-1": (SAR_OPTICAL, None),
    "labels-and-roads-overlay-different-places-0": (_OPTICAL, None),
    "noise-sd-60-sim-0": (SAR_OPTICAL, (-7.3, -11.0)),
    "seam-third-10px-oo-0": (_OPTICAL, None),
    "watermark-different-places-1": (SAR_OPTICAL, None),
}


@dataclass(frozen=True)
class Example(Scene):
    """Two files that are an attack without any change."""

    folder: Path = Path()

    def pair(self, seed: int, cache: Path) -> Pair:
        """Return the pair that the files hold."""
        images = (to_grey(read_image(self.folder / f"{name}.tif")) for name in "ri")
        reference, image = images
        shift = _KNOWN[self.name][1]
        size = image.shape[2], image.shape[1]
        shown = pixels(size) - (np.nan if shift is None else np.array(shift))
        source = Source(reference, image, lambda px: px)
        return Pair(reference, image, shown, self.kind, 0.0, source, (0, 0), self.name)


def scenes(data: Path) -> list[Scene]:
    """Return the examples in the folder of real pairs."""
    return [
        Example(name, kind, folder=data / FOLDER / name)
        for name, (kind, _) in _KNOWN.items()
        if (data / FOLDER / name).exists()
    ]


def is_example(scene: Scene) -> bool:
    """Whether a scene is an example."""
    return isinstance(scene, Example)


def _named(name: str) -> Attack:
    return Attack(EXAMPLES, name, "", untouched, lambda scene: scene.name == name)


ATTACKS = [_named(name) for name in _KNOWN]
