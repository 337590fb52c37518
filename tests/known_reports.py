"""A pair whose shift is known, and the reports on its registration."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from affine import Affine
from html_pages import Page, picture_of
from raster_files import utm_grid, wave_image, write_raster

from groundtie.geometry.accuracy import Accuracy
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.masks.used import NONE, MaskUsed
from groundtie.matching.survey import Survey
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration.registration import Registration
from groundtie.registration.verdict import Verdict
from groundtie.report.correction import Correction
from groundtie.report.report import Report

GRID = utm_grid(160, 120)
# The input claims its ground to lie 70 m to the east and 40 m to the north of the truth.
SHIFT_M = np.array([70.0, 40.0])
HOSTILE = """<script>alert(1)</script>"'&{{ 7*7 }}<img src=x onerror=alert(1)>"""

ACCEPTED = Verdict(
    accepted=True,
    reason="check points confirm the registration",
    fit_points=12,
    fit_points_used=11,
    check_points=9,
    check_points_agreeing=8,
    check_rmse_px=0.61,
    check_rmse_m=6.1,
    ce90_m=9.3,
    log10_chance=-14.2,
    spread_px=0.21,
    extrapolated_share=0.18,
    accuracy=Accuracy(0.45, 0.93, 1.2, (0.7, 1.4)),
)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ImagePair]:
    yield from opened_pair(tmp_path_factory.mktemp("pair"), GRID, SHIFT_M)


@pytest.fixture(scope="module")
def page(pair: ImagePair, tmp_path_factory: pytest.TempPathFactory) -> Page:
    """Return the page of an accepted registration."""
    return written(report_of(pair), tmp_path_factory.mktemp("page"))


@dataclass(frozen=True)
class Variant:
    """A report, its page and its numbers."""

    report: Report
    page: Page
    numbers: dict[str, Any]


@pytest.fixture(scope="module")
def variants(pair: ImagePair, tmp_path_factory: pytest.TempPathFactory) -> list[Variant]:
    """Return a report of every stage that a registration can come to."""
    transform = transform_of(pair)
    points = points_of(pair, transform)
    folder = tmp_path_factory.mktemp("variants")
    return [
        Variant(report, written(report, folder), numbers_in(folder))
        for report in (
            report_of(pair),
            refused(pair),
            refused(pair, points=points, transform=transform),
            refused(pair, points=points.take(slice(0, 12)), transform=transform),
            refused(pair, points=points.take(slice(0, 0)), transform=transform),
            report_of(pair, parameters={}, surfaces=()),
        )
    ]


@pytest.fixture
def ungeoreferenced(tmp_path: Path) -> Iterator[ImagePair]:
    grid = Grid(PIXEL_COORDINATES, None, 160, 120)
    yield from opened_pair(tmp_path, grid, np.array([7.0, 4.0]), georeferenced=False)


def opened_pair(
    folder: Path, grid: Grid, shift: np.ndarray, georeferenced: bool = True
) -> Iterator[ImagePair]:
    """Make a pair of the same waves, the input's off by a shift in map units."""
    length = 40 * grid.pixel_size[0]
    place = {"grid": grid} if georeferenced else {}
    seen = wave_image(grid, length).astype(np.float32)
    moved = wave_image(grid.shifted(*-shift), length).astype(np.float32)
    reference = write_raster(folder / "reference.tif", seen, **place)
    input = write_raster(folder / "input.tif", moved, **place)
    with open_raster(reference) as r, open_raster(input) as i:
        yield make_pair(Image(r), Image(i))


def transform_of(pair: ImagePair, shift: np.ndarray = SHIFT_M) -> Transform:
    model = PolynomialModel("translation", Frame(Affine.identity()), shift[None])
    return Transform(model, pair.grid.crs, pair.input.source.grid)


def points_of(pair: ImagePair, transform: Transform) -> TiePoints:
    """Return 12 points of the fit, of which one is rejected, and 9 check points, one far off."""
    random = np.random.default_rng(3)
    xy = pair.grid.pixel_to_map(random.uniform([5, 5], [155, 115], (21, 2)))
    error_px = random.normal(0, 0.4, (21, 2))
    error_px[-1] = [11, -6]
    points = TiePoints(
        xy,
        transform(xy) + error_px,
        np.full(21, 9.0),
        np.tile(np.eye(2) / 20, (21, 1, 1)),
        np.zeros(21),
        np.arange(21) >= 12,
        np.full(21, "used"),
    )
    return points.reject(np.arange(21) == 4, "disagrees with the model")


def peak_surface(x: float, y: float, height: float = 9.0) -> np.ndarray:
    rows, cols = np.mgrid[-8:9, -8:9]
    return (height * np.exp(-((cols - x) ** 2 + (rows - y) ** 2) / 4)).astype(np.float32)


def report_of(pair: ImagePair, **changes: Any) -> Report:
    """Return the report on a registration of a pair, or one that differs from it."""
    transform = transform_of(pair)
    page = {
        "title": "input.tif registered to reference.tif",
        "parameters": {"similarity": "fused", "max_error": 3.0},
        "seconds": 4.56,
    }
    shown = {
        "verdict": ACCEPTED,
        "points": points_of(pair, transform),
        "transform": transform,
        "surfaces": (
            ("best check point", peak_surface(1, -2)),
            ("worst check point", peak_surface(6, 3, 4.0)),
        ),
        "mask": MaskUsed(NONE, None, 1.0, "none was asked for"),
        "scene": {},
        "survey": None,
        "beyond": None,
        "tried": (),
    }
    own = {name: changes.pop(name, value) for name, value in page.items()}
    return Report(registration_of(pair, **(shown | changes)), **own)  # type: ignore[arg-type]


def registration_of(
    pair: ImagePair,
    points: TiePoints | None,
    transform: Transform | None,
    surfaces: tuple[tuple[str, np.ndarray], ...],
    scene: dict[str, Any],
    survey: Survey | None,
    **more: Any,
) -> Registration:
    """Return what a report reads of a registration."""
    found = SimpleNamespace(
        pair=pair,
        notes=pair.notes,
        tie_points=points,
        transform=transform,
        correction=None if transform is None else Correction.of(transform, pair.grid),
        extreme_surfaces=lambda: surfaces,
        scene=SimpleNamespace(facts=lambda: scene, summary=lambda: {"sensors": "cameras"}),
        survey=survey,
        **more,
    )
    return cast(Registration, found)


def refused(pair: ImagePair, **changes: Any) -> Report:
    nothing = {"points": None, "transform": None, "surfaces": ()}
    verdict = Verdict(False, "nothing in common was found")
    return report_of(pair, **{"verdict": verdict, **nothing, **changes})


def written(report: Report, folder: Path) -> Page:
    with Outputs() as outputs:
        report.write(outputs, folder / "report.html")
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def picture(page: Page, alt: str) -> np.ndarray:
    """Return the picture whose alternative text begins so."""
    (element,) = [e for e in page.all("img") if str(e.attributes["alt"]).startswith(alt)]
    uri = str(element.attributes["src"])
    return picture_of(uri, uri.removeprefix("data:").split(";")[0])


def numbers_in(folder: Path) -> dict[str, Any]:
    return strict((folder / "report.json").read_text(encoding="utf-8"))


def strict(text: str) -> Any:
    def refuse_constant(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    return json.loads(text, parse_constant=refuse_constant)
