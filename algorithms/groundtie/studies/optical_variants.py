"""Features of optical images by name: what finds them and what describes them."""

from __future__ import annotations

from ..features.descriptors import SiftDescriptor
from ..features.detectors import SiftDetector
from ..features.hog import HogDescriptor
from ..features.tiles import Describing, Detecting
from .haar import HaarDescriptor
from .surf import SurfDetector

DETECTORS = ("sift", "surf")
DESCRIPTORS = ("hog81", "hog63", "sift", "surf")

_DIRECTIONS = {"hog81": 9, "hog63": 7}


def optical_detector(name: str, threshold: float) -> Detecting:
    """Return the detector of a name of `DETECTORS`; see `SiftDetector.contrast`, `SurfDetector`."""
    return SurfDetector(threshold) if name == "surf" else SiftDetector(threshold)


def optical_descriptor(name: str) -> Describing:
    """Return the descriptor of a name of `DESCRIPTORS`, for images that are upright already."""
    if name == "surf":
        return HaarDescriptor()
    if name == "sift":
        return SiftDescriptor()
    return HogDescriptor(_DIRECTIONS[name])
