"""The demonstration measures against the truth and does not call a wrong result a success."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import groundtie.errors
from scripts import demo

SHIFT = np.array([3.0, -4.0])


def write_check_points(path: Path) -> np.ndarray:
    """Write four check points, the input at twice the map position, and return the latter."""
    xy = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 20.0], [5.0, 7.5]])
    pixels = ["reference_col", "reference_row", "input_col", "input_row"]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["reference_x", "reference_y", *pixels])
        writer.writerows(np.hstack([xy, xy + 99, 2 * xy]).tolist())
    return xy


@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_errors_are_distances_in_input_pixels(tmp_path: Path, offset: float) -> None:
    write_check_points(tmp_path / "points.csv")
    errors = demo.errors_against_truth_px(
        lambda xy: 2 * xy + offset * SHIFT, tmp_path / "points.csv"
    )
    np.testing.assert_allclose(errors, np.full(4, 5.0 * offset))


def fake_tools(
    monkeypatch: pytest.MonkeyPatch, offset: float, verdict: dict[str, Any]
) -> list[dict[str, Any]]:
    """Replace the tools by ones whose transform is off by `offset` times (3, -4) pixels."""
    calls: list[dict[str, Any]] = []

    def simulate(folder: Path) -> None:
        folder.mkdir()
        write_check_points(folder / "check_points.csv")

    def coregister(reference: Path, input: Path, output: Path, **outputs: Path) -> None:
        calls.append({"reference": reference, "input": input, "output": output, **outputs})
        text = json.dumps({"verdict": verdict})
        outputs["report"].with_suffix(".json").write_text(text, encoding="utf-8")

    def load_transform(path: Path) -> Callable[[np.ndarray], np.ndarray]:
        assert path == calls[-1]["transform"]
        return lambda xy: 2 * xy + offset * SHIFT

    for function in (simulate, coregister, load_transform):
        monkeypatch.setattr(groundtie, function.__name__, function, raising=False)
    return calls


VERDICT = {"accepted": True, "points": 87, "check_rmse_px": 0.567, "ce90_m": 0.89}


def test_says_verdict_error_and_places(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = fake_tools(monkeypatch, 0.1, VERDICT)
    monkeypatch.setattr("sys.argv", ["demo.py", str(tmp_path / "demo")])
    assert demo.main() == 0
    said = capsys.readouterr().out
    assert "accepted: 87 tie points, held-out RMSE 0.57 px, CE90 0.89 m" in said
    assert "Against the truth: RMSE 0.50 px, CE90 0.50 px at 4 check points" in said
    for name in ("output", "tie_points", "transform", "report"):
        assert str(calls[0][name]) in said
    assert calls[0]["reference"] == tmp_path / "demo/reference.tif"
    assert calls[0]["input"] == tmp_path / "demo/input.tif"


@pytest.mark.parametrize("offset", [0.61, float("nan")])
def test_accepted_but_wrong_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, offset: float
) -> None:
    fake_tools(monkeypatch, offset, VERDICT)
    monkeypatch.setattr("sys.argv", ["demo.py", str(tmp_path / "demo")])
    assert demo.main() == 1


def test_a_refusal_is_said_in_one_line_and_is_no_success(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_tools(monkeypatch, 0.0, VERDICT)

    def refuse(*_: Any, **__: Any) -> None:
        raise groundtie.errors.NotRegisteredError("no common content")

    monkeypatch.setattr(groundtie, "coregister", refuse)
    monkeypatch.setattr("sys.argv", ["demo.py", str(tmp_path / "demo")])
    assert demo.main() == 3
    assert "The demonstration failed: no common content\n" in capsys.readouterr().out
