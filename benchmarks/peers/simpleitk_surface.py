"""SimpleITK's Mattes metric at a lattice of shifts of a search window.

Run as `python simpleitk_surface.py WINDOWS.npz BINS THREADS STEP STEPS`; the file holds `template`
and `search` (larger by the same margin on each side), the shifts are -STEPS … STEPS times STEP in
columns and rows. Prints the seconds and the best shift (columns, rows) as JSON.

The exhaustive optimiser evaluates the metric alone; `MetricEvaluate` would set everything up again
for each shift and take three times as long.
"""

import json
import sys
import time

import numpy as np
import SimpleITK


def main():
    path, (bins, threads, step, steps) = sys.argv[1], map(int, sys.argv[2:6])
    SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
    with np.load(path) as arrays:
        template, search = arrays["template"], arrays["search"]
    margin = (search.shape[0] - template.shape[0]) // 2
    fixed = SimpleITK.GetImageFromArray(template.astype(np.float32))
    moving = SimpleITK.GetImageFromArray(search.astype(np.float32))
    moving.SetOrigin((-margin, -margin))
    method = SimpleITK.ImageRegistrationMethod()
    method.SetMetricAsMattesMutualInformation(bins)
    method.SetInterpolator(SimpleITK.sitkLinear)
    method.SetOptimizerAsExhaustive([steps, steps], step)
    method.SetInitialTransform(SimpleITK.TranslationTransform(2))
    started = time.perf_counter()
    found = method.Execute(fixed, moving)
    seconds = time.perf_counter() - started
    print(json.dumps({"seconds": seconds, "best_shift": found.GetParameters()}))


if __name__ == "__main__":
    main()
