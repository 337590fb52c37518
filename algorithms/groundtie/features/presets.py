"""The keypoints of the registering tools: what finds and describes them."""

from __future__ import annotations

from .descriptors import Descriptor
from .detectors import Detector
from .hog import HogDescriptor
from .tiles import Describing, Detecting


def sar_keypoints() -> tuple[Detecting, Describing]:
    """Return what matches two SAR images: SIFT without its first octave, which holds speckle."""
    return Detector("sift-oct", 0.03), Descriptor("differences")


def optical_keypoints() -> tuple[Detecting, Describing]:
    """Return what matches optical images: SIFT's keypoints by histograms of oriented gradients."""
    return Detector("sift", 0.03), HogDescriptor(9, scaled=False)
