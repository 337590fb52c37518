"""OpenCV's ECC (enhanced correlation coefficient) on the sizes of gradients: affine.

Run as `python opencv_ecc.py REFERENCE INPUT`; prints the 2×3 matrix from reference to input
pixels as JSON, null if it does not converge. ECC follows a gradient and needs a start within a few
pixels, so it goes down a pyramid: a shift first, affine on the finest level.
"""

import sys

import cv2
import numpy as np
from images import gradient_size, read
from matrices import tell, threads

SHRINK = (8, 4, 2, 1)
SMOOTHING_PX = 5
STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-6)


def shrunk(image, factor):
    # Gradients of what the level shows, not shrunk gradients: noise has averaged out.
    size = (image.shape[1] // factor, image.shape[0] // factor)
    return gradient_size(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def centred(matrix, factor):
    # Pixel p of a level is centred on factor · p + (factor − 1) / 2 of the image.
    offset = np.full(2, (factor - 1) / 2)
    shift = factor * matrix[:, 2] + offset - matrix[:, :2] @ offset
    return np.column_stack([matrix[:, :2], shift])


def register(reference, image):
    found = np.eye(2, 3)
    for factor in SHRINK:
        offset = np.full(2, (factor - 1) / 2)
        shift = (found[:, 2] - offset + found[:, :2] @ offset) / factor
        start = np.column_stack([found[:, :2], shift]).astype(np.float32)
        motion = cv2.MOTION_AFFINE if factor == 1 else cv2.MOTION_TRANSLATION
        _, level = cv2.findTransformECC(
            shrunk(reference, factor),
            shrunk(image, factor),
            start,
            motion,
            STOP,
            None,
            SMOOTHING_PX,
        )
        found = centred(level.astype(float), factor)
    return found


def main():
    cv2.setNumThreads(threads())
    try:
        tell(register(*(read(path) for path in sys.argv[1:3])))
    except cv2.error as error:
        print(error, file=sys.stderr)
        tell(None)


if __name__ == "__main__":
    main()
