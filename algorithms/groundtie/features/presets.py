"""What finds and describes the keypoints of each kind of image.

Chosen among many by `detector_repeatability` and `make bench` (see `studies`).
"""

from __future__ import annotations

from .descriptors import SiftDescriptor
from .detectors import SiftDetector, SiftOctDetector
from .hog import HogDescriptor
from .tiles import Describing, Detecting


def sar_keypoints() -> tuple[Detecting, Describing]:
    """Return the detector and the descriptor of radar images: upright SIFT-OCT ([Suri2010] 6.3)."""
    return SiftOctDetector(), SiftDescriptor()


def optical_keypoints() -> tuple[Detecting, Describing]:
    """Return those of optical images: SIFT's keypoints, described by HOG ([Patel2017] 4.3).

    HOG patches are of one size: SIFT's keypoints are too small for patches that grow with them.
    """
    return SiftDetector(), HogDescriptor()
