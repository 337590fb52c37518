"""elastix with Mattes mutual information, by its own default parameters.

Run as `python elastix_mattes.py REFERENCE INPUT translation|affine`; prints the 2×3 matrix from
reference to input pixels as JSON. An affine transform is looked for after a translation.
"""

import sys

import itk
import numpy as np
from images import read
from matrices import tell, threads

STAGES = {"translation": ("translation",), "affine": ("translation", "affine")}


def parameters(stages):
    chosen = itk.ParameterObject.New()
    for stage in stages:
        chosen.AddParameterMap(chosen.GetDefaultParameterMap(stage))
    # Georeferenced images start where they claim to lie, not with their centres aligned.
    chosen.SetParameter("AutomaticTransformInitialization", "false")
    return chosen


def affine(values):
    """Return matrix and shift of the one stage: elastix turns about a centre."""
    numbers = np.array([float(value) for value in values["TransformParameters"]])
    if values["Transform"][0] == "TranslationTransform":
        return np.eye(2), numbers
    linear, shift = numbers[:4].reshape(2, 2), numbers[4:]
    centre = np.array([float(value) for value in values["CenterOfRotationPoint"]])
    return linear, shift + centre - linear @ centre


def main():
    reference, image = (itk.image_view_from_array(read(path)) for path in sys.argv[1:3])
    _, found = itk.elastix_registration_method(
        reference,
        image,
        parameter_object=parameters(STAGES[sys.argv[3]]),
        number_of_threads=threads(),
        log_to_console=False,
    )
    linear, shift = np.eye(2), np.zeros(2)
    for stage in range(found.GetNumberOfParameterMaps()):
        # Each stage is applied to what the stages before it return.
        more, beyond = affine(found.GetParameterMap(stage))
        linear, shift = more @ linear, more @ shift + beyond
    tell(np.column_stack([linear, shift]))


if __name__ == "__main__":
    main()
