"""What cannot be registered is refused or an error, and leaves nothing behind."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from raster_files import full_disk, utm_grid
from textured_pairs import (
    TexturedPair,
    listing,
    rewritten,
    texture,
    write_textured_pair,
)

from groundtie.cli import main
from groundtie.errors import (
    BandError,
    CancelledError,
    GeoreferencingError,
    GroundTieError,
    NoOverlapError,
    NotRegisteredError,
    OutputError,
    ParameterError,
    RasterContentError,
    RasterOpenError,
    SameFileError,
)
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.progress import Progress
from groundtie.registration.registration import Registration
from groundtie.tools.coregister import coregister

SIZE = (240, 220)


def registered(pair: TexturedPair, folder: Path, **more: Any) -> Registration:
    return coregister(pair.reference, pair.input, folder / "out.tif", **{"workers": 2} | more)


def noise_image(values: np.ndarray) -> np.ndarray:
    return np.random.default_rng(5).integers(1, 3000, values.shape).astype(np.uint16)


def other_place(values: np.ndarray) -> np.ndarray:
    return (2000 - 300 * texture(*values.shape, seed=77)).astype(np.uint16)


@pytest.mark.parametrize("shown", [noise_image, other_place])
@pytest.mark.slow
def test_what_is_not_the_same_place_is_refused(
    textured: TexturedPair, tmp_path: Path, shown: Any
) -> None:
    pair = rewritten(textured, tmp_path, input=shown)
    before = listing(tmp_path)
    with pytest.raises(NotRegisteredError, match=r"input\.tif was not registered") as error:
        coregister(
            pair.reference,
            pair.input,
            tmp_path / "out.tif",
            tie_points=tmp_path / "points.gpkg",
            transform=tmp_path / "t.json",
        )
    assert error.value.verdict is not None
    assert not error.value.verdict.accepted
    assert listing(tmp_path) == before


@pytest.mark.slow
def test_a_refusal_on_the_command_line(
    textured: TexturedPair, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 3, one line, the verdict as JSON; nothing is written but the report."""
    pair = rewritten(textured, tmp_path, input=noise_image)
    before = listing(tmp_path)
    args = [
        "coregister",
        str(pair.reference),
        str(pair.input),
        str(tmp_path / "out.tif"),
        "--report",
        str(tmp_path / "report.html"),
        "--json",
    ]
    assert main(args) == 3
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "input.tif was not registered to" in printed.err
    assert json.loads(printed.out)["verdict"]["accepted"] is False
    assert set(listing(tmp_path)) - set(before) == {"report.html", "report.json"}
    title = "<title>Refused: input.tif not registered to reference.tif</title>"
    assert title in (tmp_path / "report.html").read_text()
    numbers = json.loads((tmp_path / "report.json").read_text())
    assert numbers["verdict"] == json.loads(printed.out)["verdict"]
    assert numbers["verdict"]["reason"] in printed.err


@pytest.mark.slow
def test_an_error_limit_below_what_is_possible_is_refused(
    textured: TexturedPair, tmp_path: Path
) -> None:
    bent = PolynomialModel(
        "polynomial2",
        Frame.around(textured.grid.pixel_to_map(textured.grid.outline())),
        np.array([[0, 0], [0, 0], [0, 0], [0.02, -0.02], [0.02, 0], [-0.02, 0.02]]),
    )
    pair = write_textured_pair(tmp_path, SIZE, bent)
    with pytest.raises(NotRegisteredError, match=r"above 0\.3 px|vary|varies|by chance"):
        registered(pair, tmp_path, model="translation", max_error=0.3)
    assert not (tmp_path / "out.tif").exists()


def far_away(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
    return values, {"grid": utm_grid(*SIZE).shifted(1e6, 0)}


def no_crs(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
    return values, {"grid": replace(utm_grid(*SIZE), crs=None)}


def constant(values: np.ndarray) -> np.ndarray:
    return np.full_like(values, 7)


def all_nodata(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
    return np.zeros_like(values), {"nodata": 0}


def all_nan(values: np.ndarray) -> np.ndarray:
    return np.full(values.shape, np.nan, np.float32)


def infinite(values: np.ndarray) -> np.ndarray:
    return np.full(values.shape, np.inf, np.float32)


BAD_IMAGES: dict[str, tuple[Any, type[GroundTieError], str]] = {
    "no overlap": (far_away, NoOverlapError, "overlap"),
    "no CRS": (no_crs, GeoreferencingError, "CRS"),
    "no georeferencing": (lambda v: (v, {"grid": None}), GeoreferencingError, "georeferencing"),
    "constant": (constant, RasterContentError, "constant"),
    "all nodata": (all_nodata, RasterContentError, "no valid pixel"),
    "all NaN": (all_nan, RasterContentError, "no valid pixel"),
    "all infinite": (infinite, RasterContentError, "no valid pixel"),
    "too small": (lambda v: v[:60, :60], NoOverlapError, "144 × 144 are needed"),
}


def fails_on_the_command_line(
    args: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> str:
    """Return the one line that a call says; it must end with 2 and leave all files alone."""
    before = listing(folder)
    assert main(args) == 2
    assert listing(folder) == before
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert printed.err.startswith("groundtie: error: ")
    return printed.err


@pytest.mark.parametrize("which", ["reference", "input"])
@pytest.mark.parametrize("name", BAD_IMAGES)
def test_bad_images_are_named(
    textured: TexturedPair, tmp_path: Path, capsys: Any, name: str, which: str
) -> None:
    change, error, text = BAD_IMAGES[name]
    pair = rewritten(textured, tmp_path, **{which: change})
    with pytest.raises(error):
        registered(pair, tmp_path)
    report = ["--report", str(tmp_path / "report.html")]
    args = ["coregister", str(pair.reference), str(pair.input), str(tmp_path / "out.tif"), *report]
    said = fails_on_the_command_line(args, tmp_path, capsys)
    assert text in said
    assert f"{which}.tif" in said


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def garbled(path: Path) -> None:
    path.write_bytes(b"this is no raster" * 100)


@pytest.mark.parametrize("which", ["reference", "input"])
@pytest.mark.parametrize("damage", [truncated, garbled, Path.unlink])
def test_damaged_files_are_named(
    textured: TexturedPair, tmp_path: Path, capsys: Any, damage: Any, which: str
) -> None:
    pair = rewritten(textured, tmp_path)
    damage(getattr(pair, which))
    with pytest.raises(RasterOpenError, match=f"{which}.tif"):
        registered(pair, tmp_path)
    args = ["coregister", str(pair.reference), str(pair.input), str(tmp_path / "out.tif")]
    assert f"{which}.tif" in fails_on_the_command_line(args, tmp_path, capsys)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"reference_band": 2}, BandError, "reference.tif has no band 2"),
        ({"input_band": 9}, BandError, "input.tif has no band 9"),
        ({"model": "affine", "output_grid": "untouched"}, ParameterError, "untouched"),
        ({"output_grid": "best"}, ParameterError, "best"),
        ({"max_error": 0}, ParameterError, "0.1 to 100"),
        ({"search_radius": -1}, ParameterError, "at least 0"),
        ({"tie_points": "points.shp"}, ParameterError, "points.shp"),
        ({"report": "missing/report.html"}, OutputError, "missing"),
        ({"transform": "input.tif"}, ParameterError, "json"),
        ({"input_mask": "nowhere.tif"}, RasterOpenError, "nowhere.tif"),
    ],
)
def test_bad_parameters(
    textured: TexturedPair,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Any,
    options: dict[str, Any],
    error: type[GroundTieError],
    text: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    pair = rewritten(textured, tmp_path)
    with pytest.raises(error, match=text.replace("_", ".")):
        registered(pair, tmp_path, **options)
    words = [f"--{k.replace('_', '-')}={v}" for k, v in options.items()]
    args = ["coregister", str(pair.reference), str(pair.input), str(tmp_path / "out.tif"), *words]
    assert text in fails_on_the_command_line(args, tmp_path, capsys)


@pytest.mark.parametrize(
    ("reference", "input", "output"),
    [
        ("reference.tif", "reference.tif", "out.tif"),
        ("reference.tif", "./reference.tif", "out.tif"),
        ("reference.tif", "input.tif", "input.tif"),
        ("reference.tif", "input.tif", "reference.tif"),
    ],
)
def test_files_that_must_differ(
    textured: TexturedPair,
    tmp_path: Path,
    monkeypatch: Any,
    capsys: Any,
    reference: str,
    input: str,
    output: str,
) -> None:
    rewritten(textured, tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SameFileError):
        coregister(reference, input, output)
    args = ["coregister", reference, input, output]
    assert "same" in fails_on_the_command_line(args, tmp_path, capsys)


def test_a_link_to_the_reference_is_the_reference(textured: TexturedPair, tmp_path: Path) -> None:
    link = tmp_path / "link.tif"
    link.symlink_to(textured.reference)
    with pytest.raises(SameFileError):
        coregister(textured.reference, link, tmp_path / "out.tif")


@pytest.mark.slow
@pytest.mark.parametrize("free_bytes", [0, 40_000])
def test_a_full_disk_leaves_nothing(
    textured: TexturedPair, tmp_path: Path, free_bytes: int
) -> None:
    old = tmp_path / "out.tif"
    old.write_bytes(b"an older result")
    before = listing(tmp_path)
    with full_disk(free_bytes), pytest.raises(OutputError, match=r"cannot write .*(out|t)\."):
        registered(textured, tmp_path, transform=tmp_path / "t.json")
    assert listing(tmp_path) == before


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_to(
    textured: TexturedPair, tmp_path: Path, capsys: Any
) -> None:
    missing = tmp_path / "missing" / "out.tif"
    args = ["coregister", str(textured.reference), str(textured.input), str(missing)]
    assert "missing" in fails_on_the_command_line(args, tmp_path, capsys)
    with pytest.raises(OutputError, match="/proc"):
        coregister(textured.reference, textured.input, "/proc/out.tif")


@pytest.mark.slow
@pytest.mark.parametrize("message", ["coarse", "tie points", "took no part", "writing"])
def test_cancelling_leaves_nothing(textured: TexturedPair, tmp_path: Path, message: str) -> None:
    said = ""

    def report(fraction: float, text: str) -> None:
        nonlocal said
        assert 0 <= fraction <= 1
        said = text or said

    before = listing(tmp_path)
    progress = Progress(report, lambda: message in said)
    with pytest.raises(CancelledError, match="nothing was written"):
        registered(
            textured,
            tmp_path,
            transform=tmp_path / "t.json",
            progress=progress,
            report=tmp_path / "report.html",
        )
    assert listing(tmp_path) == before


@pytest.mark.slow
def test_progress_rises_to_the_end(textured: TexturedPair, tmp_path: Path) -> None:
    fractions: list[float] = []
    registered(textured, tmp_path, progress=Progress(lambda f, _: fractions.append(f)))
    assert fractions[0] == 0
    assert fractions[-1] == pytest.approx(1)
    assert (np.diff(fractions) >= -1e-9).all()
