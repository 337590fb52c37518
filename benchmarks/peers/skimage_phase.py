"""scikit-image's phase correlation: a shift.

Run as `python skimage_phase.py REFERENCE INPUT grey|gradients`; prints the 2×3 matrix from
reference to input pixels as JSON. Both images are faded out towards their borders, which phase
correlation would match otherwise.
"""

import sys

from images import gradient_size, read
from matrices import tell, translation
from skimage.filters import window
from skimage.registration import phase_cross_correlation

UPSAMPLING = 20


def faded(image):
    return (image - image.mean()) * window("hann", image.shape)


def main():
    images = [read(path) for path in sys.argv[1:3]]
    if sys.argv[3] == "gradients":
        images = [gradient_size(image) for image in images]
    (rows, columns), *_ = phase_cross_correlation(*map(faded, images), upsample_factor=UPSAMPLING)
    # It returns what moves the second image onto the first.
    tell(translation((-columns, -rows)))


if __name__ == "__main__":
    main()
