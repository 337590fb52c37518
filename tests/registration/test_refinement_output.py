"""What a refinement writes: the RPCs that it found, in each of their formats."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from raster_files import write_raster
from rpc_models import camera_rpc

from groundtie.progress import SILENT
from groundtie.rasters.reading import open_raster
from groundtie.registration.refinement_output import RefinementFiles, _write_rpcs
from groundtie.registration.sensor_input import open_sensor_image
from groundtie.sensor.rpc_files import read_rpc

SIZE = (60, 50)


@pytest.mark.parametrize("name", ["refined_RPC.TXT", "refined.rpb", "copy.tif", "copy.TIFF"])
def test_the_refined_rpcs_are_written_in_the_format_of_the_name(tmp_path: Path, name: str) -> None:
    path = write_raster(tmp_path / "image.tif", np.arange(3000, dtype=np.uint16).reshape(50, 60))
    fit: Any = SimpleNamespace(rpc=camera_rpc(SIZE))
    with open_raster(path) as source:
        image: Any = SimpleNamespace(source=source)
        _write_rpcs(image, fit, tmp_path / name, SILENT)
    lon_lat = fit.rpc.localise([[0.0, 0.0], [59.0, 49.0]], 0.0)
    if name.startswith("copy"):
        with ExitStack() as stack:
            _, found = open_sensor_image(tmp_path / name, None, stack)
    else:
        found = read_rpc(tmp_path / name)
    np.testing.assert_allclose(found.project(lon_lat, 0.0), [[0, 0], [59, 49]], atol=1e-3)


def test_only_what_is_asked_for_is_named(tmp_path: Path) -> None:
    files = RefinementFiles(tmp_path / "r.txt", None, tmp_path / "r.html", {})
    assert files.written() == {
        "output": str(tmp_path / "r.txt"),
        "report": str(tmp_path / "r.html"),
    }
