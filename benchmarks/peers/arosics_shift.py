"""AROSICS' co-registration: one global shift, or an affine fit to its local tie points.

Run as `python arosics_shift.py REFERENCE INPUT MAX_SHIFT_PX global|local`; prints the 2×3 matrix
from reference to input pixels as JSON, null if AROSICS finds no valid match. Both rasters must have
the same grid. Its author says that it is not made for SAR–optical pairs.
"""

import sys

import numpy as np
from arosics import COREG, COREG_LOCAL
from matrices import tell, threads, translation

WINDOW_PX = 256
SPACING_PX = 50
# AROSICS' default of 60 leaves hardly a point on pairs of different sensors.
LEAST_RELIABILITY = 20
LEAST_POINTS = 6


def global_shift(reference, image, common):
    found = COREG(reference, image, ws=(WINDOW_PX, WINDOW_PX), **common)
    found.calculate_spatial_shifts()
    if not found.success:
        return None
    # It returns what moves the input onto the reference.
    return translation((-found.x_shift_px, -found.y_shift_px))


def local_affine(reference, image, common):
    local = COREG_LOCAL(
        reference,
        image,
        grid_res=SPACING_PX,
        window_size=(WINDOW_PX, WINDOW_PX),
        min_reliability=LEAST_RELIABILITY,
        **common,
    )
    table = local.CoRegPoints_table
    if "OUTLIER" not in table:
        return None
    table = table[~table["OUTLIER"].astype(bool)]
    if len(table) < LEAST_POINTS:
        return None
    here = table[["X_IM", "Y_IM"]].to_numpy(float)
    there = here - table[["X_SHIFT_PX", "Y_SHIFT_PX"]].to_numpy(float)
    design = np.column_stack([here, np.ones(len(here))])
    return np.linalg.lstsq(design, there, rcond=None)[0].T


def main():
    reference, image, max_shift, which = sys.argv[1:]
    common = {
        "max_shift": int(max_shift),
        "CPUs": threads(),
        "progress": False,
        "q": True,
        "ignore_errors": True,
    }
    find = {"global": global_shift, "local": local_affine}[which]
    tell(find(reference, image, common))


if __name__ == "__main__":
    main()
