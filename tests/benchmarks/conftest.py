"""A folder with two small cases."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from benchmark_cases import CHECK_POINT_ERROR_PX, MATRIX, SIZES, image, to_input

from benchmarks.cases import RealCase, read_cases, write_image


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Return a folder with cases.json: 'hills' has check points, 'plain' has none."""
    folder = tmp_path / "data"
    (folder / "hills").mkdir(parents=True)
    for which in SIZES:
        write_image(image(which), Affine.identity(), folder / "hills" / f"{which}.tif")
    # Check points that the matrix misses by as much in every direction.
    px = np.array([[10.0, 10.0], [60.0, 20.0], [30.0, 70.0], [80.0, 60.0]])
    off = CHECK_POINT_ERROR_PX * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    rows = np.hstack([px, to_input(px + off)])
    np.savetxt(
        folder / "hills" / "check_points.csv",
        rows,
        delimiter=",",
        header="reference_col,reference_row,input_col,input_row",
        comments="",
    )
    truth = {"sigma_px": 2.0, "reference_to_input": MATRIX.tolist()}
    files = {which: f"hills/{which}.tif" for which in SIZES}
    cases = [
        {
            "id": "hills",
            "kind": "sar-optical",
            "truth": {**truth, "check_points": "check_points.csv"},
            **files,
        },
        {"id": "plain", "kind": "optical-optical", "truth": truth, **files},
        {"id": "turned", "kind": "sar-optical-rotated", "truth": truth, **files},
        {"id": "sensor", "kind": "rpc", "truth": {"type": "relative"}},
    ]
    (folder / "cases.json").write_text(json.dumps(cases))
    return folder


@pytest.fixture
def cases(data: Path) -> dict[str, RealCase]:
    return {case.name: case for case in read_cases(data)}
