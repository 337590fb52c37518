"""AROSICS' local co-registration.

Run as `python arosics_local.py REFERENCE INPUT OUTPUT MAX_SHIFT_PX`; prints the number of its tie
points as JSON. Its author says that it is not made for SAR–optical pairs: only its time counts.
"""

import json
import os
import sys

from arosics import COREG_LOCAL

# About as many points as GroundTie takes, in windows of AROSICS' default size.
SPACING_PX = 100
WINDOW_PX = 256


def main():
    reference, image, output, max_shift = sys.argv[1:5]
    local = COREG_LOCAL(
        reference,
        image,
        grid_res=SPACING_PX,
        window_size=(WINDOW_PX, WINDOW_PX),
        max_shift=int(max_shift),
        min_reliability=20,
        path_out=output,
        fmt_out="GTiff",
        CPUs=os.cpu_count(),
        progress=False,
        q=True,
    )
    local.correct_shifts()
    table = local.CoRegPoints_table
    points = int((~table["OUTLIER"].astype(bool)).sum()) if "OUTLIER" in table else 0
    print(json.dumps({"tie_points": points, "of": len(table)}))


if __name__ == "__main__":
    main()
