"""Simulate a SAR-optical pair, register it and compare the result with the simulator's truth."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

import groundtie
from groundtie.errors import GroundTieError

# Limit of the demonstration's error: the default limit of `coregister`.
MAX_ERROR_PX = 3.0

Mapping = Callable[[np.ndarray], np.ndarray]


def errors_against_truth_px(transform: Mapping, check_points: Path) -> np.ndarray:
    """Measure a transform at check points.

    Parameters
    ----------
    transform : callable
        Maps reference map positions, float64 shape (n, 2), to input pixels (col, row).
    check_points : Path
        CSV with the columns reference_x, reference_y, input_col and input_row.

    Returns
    -------
    ndarray
        Distances in input pixels, float64 shape (n,).
    """
    rows = np.genfromtxt(check_points, delimiter=",", names=True)
    found = transform(np.column_stack([rows["reference_x"], rows["reference_y"]]))
    return np.linalg.norm(found - np.column_stack([rows["input_col"], rows["input_row"]]), axis=1)


def describe_verdict(numbers: dict) -> str:
    """Summarise in one line the report's JSON of an accepted registration."""
    verdict = numbers["verdict"]
    return (
        f"accepted: {verdict['points']} tie points, held-out RMSE "
        f"{verdict['check_rmse_px']:.2f} px, CE90 {verdict['ce90_m']:.2f} m"
    )


def run(folder: Path) -> float:
    """Run the demonstration in a folder and return the RMSE against the truth in pixels."""
    print(f"Simulating a SAR-optical pair in {folder} ...", flush=True)
    groundtie.simulate(folder)
    outputs = {
        "registered image": folder / "registered.tif",
        "tie points": folder / "tie_points.gpkg",
        "transform": folder / "transform.json",
        "report": folder / "report.html",
    }
    print("Registering the optical image to the SAR image ...", flush=True)
    groundtie.coregister(
        folder / "reference.tif",
        folder / "input.tif",
        outputs["registered image"],
        tie_points=outputs["tie points"],
        transform=outputs["transform"],
        report=outputs["report"],
    )
    transform = groundtie.load_transform(outputs["transform"])
    errors_px = errors_against_truth_px(transform, folder / "check_points.csv")
    rmse_px = float(np.sqrt(np.mean(errors_px**2)))

    numbers = json.loads(outputs["report"].with_suffix(".json").read_text(encoding="utf-8"))
    print(f"\nVerdict: {describe_verdict(numbers)}")
    print(
        f"Against the truth: RMSE {rmse_px:.2f} px, CE90 {np.quantile(errors_px, 0.9):.2f} px "
        f"at {len(errors_px)} check points"
    )
    for name, path in outputs.items():
        print(f"{name.capitalize() + ':':<18}{path}")
    return rmse_px


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the results go")
    try:
        rmse_px = run(parser.parse_args().folder)
    except GroundTieError as error:
        print(f"The demonstration failed: {error.one_line()}")
        return error.exit_code
    # `not <=` instead of `>`, so that NaN counts as a failure.
    if not rmse_px <= MAX_ERROR_PX:
        print(f"The registration was accepted but is off by more than {MAX_ERROR_PX} px.")
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
