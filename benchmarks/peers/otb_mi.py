"""The Orfeo ToolBox's FineRegistration with mutual information: a shift.

Run as `python otb_mi.py REFERENCE INPUT RADIUS_PX`; prints the 2×3 matrix from reference to input
pixels as JSON. The application makes a field of displacements; the one of a large window at the
centre is the shift. Both rasters must have the same grid.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import rasterio
from matrices import tell, threads, translation

# The toolbox is unpacked beside the Python that runs this.
ROOT = Path(sys.prefix) / "root" / "usr"
LIBRARIES = ROOT / "lib" / "x86_64-linux-gnu"
LARGEST_METRIC_RADIUS_PX = 150


def displacement(reference, image, radius):
    """Return the displacement (x, y), in map units, of the window at the reference's centre."""
    environment = {
        **os.environ,
        "LD_LIBRARY_PATH": f"{LIBRARIES}:{ROOT / 'lib'}",
        "OTB_APPLICATION_PATH": str(LIBRARIES / "otb" / "applications"),
        "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS": str(threads()),
        "LC_NUMERIC": "C",
    }
    with rasterio.open(reference) as source:
        steps = source.width // 2, source.height // 2
    metric_radius = min(LARGEST_METRIC_RADIUS_PX, min(steps) - radius)
    with tempfile.TemporaryDirectory() as folder:
        field = Path(folder) / "field.tif"
        options = {
            "ref": reference,
            "sec": image,
            # Displacements are on a grid of these steps from the first pixel: the second one
            # each way is the centre. The others are not made.
            "out": f"{field}?&box=1:1:1:1",
            "erx": radius,
            "ery": radius,
            "mrx": metric_radius,
            "mry": metric_radius,
            "ssrx": steps[0],
            "ssry": steps[1],
            "m": "MI",
        }
        words = [str(word) for name, value in options.items() for word in (f"-{name}", value)]
        launcher = ROOT / "bin" / "otbApplicationLauncherCommandLine"
        subprocess.run(
            [launcher, "FineRegistration", *words], env=environment, check=True, stdout=sys.stderr
        )
        with rasterio.open(field) as source:
            assert (source.width, source.height) == (1, 1)
            return source.read([1, 2])[:, 0, 0]


def main():
    reference, image, radius = sys.argv[1:]
    moved = displacement(reference, image, int(radius))
    with rasterio.open(reference) as source:
        pixel = source.transform
    tell(translation((moved[0] / pixel.a, moved[1] / pixel.e)))


if __name__ == "__main__":
    main()
