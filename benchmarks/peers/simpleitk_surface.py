"""SimpleITK's Mattes metric at many shifts of a search window.

Run as `python simpleitk_surface.py WINDOWS.npz BINS THREADS`; the file holds `template`, `search`
(larger by the same margin on each side) and `shifts`, (columns, rows). Prints the seconds as JSON.
"""

import json
import sys
import time

import numpy as np
import SimpleITK


def main():
    path, bins, threads = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
    with np.load(path) as arrays:
        template, search, shifts = arrays["template"], arrays["search"], arrays["shifts"]
    margin = (search.shape[0] - template.shape[0]) // 2
    fixed = SimpleITK.GetImageFromArray(template.astype(np.float32))
    moving = SimpleITK.GetImageFromArray(search.astype(np.float32))
    moving.SetOrigin((-margin, -margin))
    method = SimpleITK.ImageRegistrationMethod()
    method.SetMetricAsMattesMutualInformation(bins)
    method.SetInterpolator(SimpleITK.sitkLinear)
    started = time.perf_counter()
    values = []
    for shift in shifts:
        method.SetInitialTransform(SimpleITK.TranslationTransform(2, shift.tolist()))
        values.append(method.MetricEvaluate(fixed, moving))
    seconds = time.perf_counter() - started
    best = shifts[int(np.argmin(values))].tolist()
    print(json.dumps({"seconds": seconds, "evaluations": len(shifts), "best_shift": best}))


if __name__ == "__main__":
    main()
