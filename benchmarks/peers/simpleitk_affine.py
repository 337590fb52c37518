"""SimpleITK's affine registration by Mattes mutual information, as its examples set it up.

Run as `python simpleitk_affine.py REFERENCE INPUT OUTPUT`; prints the 2×3 matrix from reference
to input pixels as JSON. The input's mean of all bands is matched, and all bands are resampled.
"""

import json
import sys

import numpy as np
import rasterio
import SimpleITK

BINS = 64
LEVELS = {"shrink": [4, 2, 1], "smoothing": [2, 1, 0]}
LEARNING_RATE = 1.0
ITERATIONS = 100


def read(path):
    with rasterio.open(path) as source:
        return source.read().astype(np.float32), source.profile


def register(fixed, moving):
    method = SimpleITK.ImageRegistrationMethod()
    method.SetMetricAsMattesMutualInformation(BINS)
    method.SetInterpolator(SimpleITK.sitkLinear)
    method.SetOptimizerAsGradientDescent(LEARNING_RATE, ITERATIONS)
    method.SetOptimizerScalesFromPhysicalShift()
    method.SetShrinkFactorsPerLevel(LEVELS["shrink"])
    method.SetSmoothingSigmasPerLevel(LEVELS["smoothing"])
    start = SimpleITK.AffineTransform(2)
    start.SetCenter([(size - 1) / 2 for size in fixed.GetSize()])
    method.SetInitialTransform(start, inPlace=True)
    method.Execute(fixed, moving)
    return start


def matrix(transform):
    base, along_col, along_row = (
        np.array(transform.TransformPoint(point)) for point in ((0, 0), (1, 0), (0, 1))
    )
    return np.column_stack([along_col - base, along_row - base, base]).tolist()


def main():
    reference, profile = read(sys.argv[1])
    image, input_profile = read(sys.argv[2])
    fixed = SimpleITK.GetImageFromArray(reference.mean(0))
    transform = register(fixed, SimpleITK.GetImageFromArray(image.mean(0)))
    profile.update(count=len(image), dtype=input_profile["dtype"])
    with rasterio.open(sys.argv[3], "w", **profile) as target:
        for number, band in enumerate(image, start=1):
            moved = SimpleITK.Resample(
                SimpleITK.GetImageFromArray(band), fixed, transform, SimpleITK.sitkBSpline
            )
            values = SimpleITK.GetArrayFromImage(moved)
            target.write(np.clip(np.rint(values), 0, 65535).astype(profile["dtype"]), number)
    print(json.dumps(matrix(transform)))


if __name__ == "__main__":
    main()
