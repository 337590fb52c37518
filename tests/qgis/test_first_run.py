"""How long the first run in a QGIS that has just started lasts: all that it needs is imported then.

`scripts/test_debian.sh -s tests/qgis/test_first_run.py` prints the seconds.
"""

from __future__ import annotations

import compileall
import subprocess
import sys
from pathlib import Path

import groundtie

FIRST_RUN = """
import os, sys, time
sys.path[:0] = ["/usr/share/qgis/python/plugins", {plugins!r}]
from qgis.core import QgsApplication, QgsProcessingContext, QgsProcessingFeedback
app = QgsApplication([], True)
QgsApplication.initQgis()
from processing.core.Processing import Processing
Processing.initialize()
import groundtie_qgis
plugin = groundtie_qgis.classFactory(None)
plugin.initProcessing()
context, feedback = QgsProcessingContext(), QgsProcessingFeedback()
start, begun = time.perf_counter(), time.process_time()
algorithm = plugin.provider.algorithm("coregister").create()
results, done = algorithm.run({values!r}, context, feedback)
print(time.process_time() - begun, time.perf_counter() - start)
assert done, feedback.textLog()
sys.stdout.flush()
os._exit(0)
"""


def test_the_first_run_makes_image_tie_points_and_report(
    plugin_folder: Path, tmp_path: Path
) -> None:
    """What the dialog makes by default; how long it takes is printed, for a free machine."""
    groundtie.simulate(tmp_path / "pair", size=500, density="rural", looks=4)
    values = {
        "REFERENCE": str(tmp_path / "pair/reference.tif"),
        "INPUT": str(tmp_path / "pair/input.tif"),
        "OUTPUT": str(tmp_path / "registered.tif"),
        "TIE_POINTS": str(tmp_path / "tie_points.gpkg"),
        "REPORT": str(tmp_path / "report.html"),
    }
    compileall.compile_dir(plugin_folder, quiet=1)  # As a start before leaves it.
    script = FIRST_RUN.format(plugins=str(plugin_folder), values=values)
    called = subprocess.run(
        [sys.executable, "-c", script], text=True, capture_output=True, check=False, timeout=300
    )
    assert called.returncode == 0, called.stderr
    assert all(Path(values[name]).is_file() for name in ("OUTPUT", "TIE_POINTS", "REPORT"))
    processor, clock = map(float, called.stdout.split()[-2:])
    print(f"first run of coregister on 500 px: {processor:.1f} s of processor, {clock:.1f} s")
