"""Features of optical images by name: what finds them and what describes them."""

from __future__ import annotations

from .descriptors import Descriptor
from .detectors import Detector
from .haar import HaarDescriptor
from .hog import HogDescriptor
from .surf import SurfDetector
from .tiles import Describing, Detecting

DETECTORS = ("sift", "surf")
DESCRIPTORS = ("hog81", "hog63", "sift", "surf")

# SIFT's features are smaller than SURF's: too small for a patch that grows with them.
_DIRECTIONS = {"hog81": 9, "hog63": 7}


def optical_detector(name: str, threshold: float) -> Detecting:
    """Return the detector of a name of `DETECTORS`; see `Detector.contrast`, `SurfDetector`."""
    return SurfDetector(threshold) if name == "surf" else Detector("sift", threshold)


def optical_descriptor(name: str) -> Describing:
    """Return the descriptor of a name of `DESCRIPTORS`, for images that are upright already."""
    if name == "surf":
        return HaarDescriptor()
    if name == "sift":
        return Descriptor()
    return HogDescriptor(_DIRECTIONS[name], scaled=False)
