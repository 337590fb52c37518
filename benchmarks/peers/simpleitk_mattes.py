"""SimpleITK's registration by Mattes mutual information: a shift, or affine after a shift.

Run as `python simpleitk_mattes.py REFERENCE INPUT translation|affine`; prints the 2×3 matrix from
reference to input pixels as JSON.
"""

import sys

import SimpleITK
from images import read
from matrices import tell, threads
from simpleitk_affine import BINS, matrix

SHRINK = {"translation": (4, 2, 1), "affine": (2, 1)}
STEP_PX = 2.0
SMALLEST_STEP_PX = 0.01
ITERATIONS = 200


def register(fixed, moving, start, shrink):
    """Return the transform that maximises mutual information, from a start."""
    method = SimpleITK.ImageRegistrationMethod()
    method.SetMetricAsMattesMutualInformation(BINS)
    method.SetInterpolator(SimpleITK.sitkLinear)
    method.SetOptimizerAsRegularStepGradientDescent(STEP_PX, SMALLEST_STEP_PX, ITERATIONS)
    method.SetOptimizerScalesFromPhysicalShift()
    method.SetShrinkFactorsPerLevel(shrink)
    method.SetSmoothingSigmasPerLevel([factor / 2 for factor in shrink])
    method.SetInitialTransform(start, inPlace=True)
    method.Execute(fixed, moving)
    return start


def main():
    SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(threads())
    images = [SimpleITK.GetImageFromArray(read(path)) for path in sys.argv[1:3]]
    found = register(*images, SimpleITK.TranslationTransform(2), SHRINK["translation"])
    if sys.argv[3] == "affine":
        start = SimpleITK.AffineTransform(2)
        start.SetCenter([(size - 1) / 2 for size in images[0].GetSize()])
        start.SetTranslation(found.GetOffset())
        found = register(*images, start, SHRINK["affine"])
    tell(matrix(found))


if __name__ == "__main__":
    main()
