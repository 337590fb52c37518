"""SIFT, the ratio test and MAGSAC++ as OpenCV has them: affine.

Run as `python opencv_sift.py REFERENCE INPUT`; prints the 2×3 matrix from reference to input
pixels as JSON, null if too few matches agree.
"""

import sys

import cv2
import numpy as np
from images import read
from matrices import tell, threads

RATIO = 0.8
THRESHOLD_PX = 3.0
# Three pairs always agree on an affine transform; chance brings one or two more.
LEAST_INLIERS = 8
CLIP_PERCENT = 1


def to_bytes(image):
    low, high = np.percentile(image, [CLIP_PERCENT, 100 - CLIP_PERCENT])
    return (np.clip((image - low) / max(high - low, 1e-9), 0, 1) * 255).astype(np.uint8)


def register(reference, image):
    sift = cv2.SIFT_create()
    points, descriptors = zip(
        *(sift.detectAndCompute(to_bytes(i), None) for i in (reference, image)), strict=True
    )
    if any(d is None or len(d) < LEAST_INLIERS for d in descriptors):
        return None
    nearest = cv2.BFMatcher().knnMatch(*descriptors, k=2)
    good = [best for best, other in nearest if best.distance < RATIO * other.distance]
    if len(good) < LEAST_INLIERS:
        return None
    here = np.array([points[0][match.queryIdx].pt for match in good])
    there = np.array([points[1][match.trainIdx].pt for match in good])
    matrix, inliers = cv2.estimateAffine2D(
        here, there, method=cv2.USAC_MAGSAC, ransacReprojThreshold=THRESHOLD_PX
    )
    if matrix is None or int(inliers.sum()) < LEAST_INLIERS:
        return None
    return matrix


def main():
    cv2.setNumThreads(threads())
    tell(register(*(read(path) for path in sys.argv[1:3])))


if __name__ == "__main__":
    main()
