"""What the page on a registration shows."""

from __future__ import annotations

import base64
import math
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from affine import Affine
from html_pages import Page, picture_of
from known_reports import (
    ACCEPTED,
    GRID,
    numbers_in,
    picture,
    refused,
    report_of,
    transform_of,
    written,
)
from raster_files import write_raster
from rasterio.crs import CRS

from groundtie.geometry.accuracy import Ellipse
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import shift_model
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import ImagePair
from groundtie.rasters.reading import open_raster
from groundtie.registration.verdict import Verdict
from groundtie.report.correction import Correction
from groundtie.report.details import SIDE_PX


def test_the_verdict_comes_first(page: Page) -> None:
    assert page.all("h2")[0].text == "Accepted"
    assert page.all("title")[0].text == "Accepted: input.tif registered to reference.tif"
    assert "Check points confirm the registration." in page.text
    assert page.numbers == {
        "Error at check points (RMSE)": "0.61 px 6.10 m",
        "Accuracy of the transform (CE90)": "0.93 px 9.30 m (0.70 to 1.40)",
        "Check points that agree": "8 of 9",
        "Agreement by chance": "1 in 1014",  # 10 to the 14th: the exponent is raised
        "Points used in the fit": "11 of 12",
        "Model": "translation",
        "Uncertainty of the model": "0.21 px 2.10 m",
        "Extrapolated": "18 % of the overlap",
    }
    assert [e.text for e in page.all("sup")] == ["14"]
    assert "less than 0.93 px (9.30 m) with 90 %, by less than 0.45 px with 50 %" in page.text
    assert "18 % of the overlap lies outside" in page.text


def test_the_error_ellipse_is_shown_where_it_is_known(pair: ImagePair, tmp_path: Path) -> None:
    accuracy = replace(ACCEPTED.accuracy, ellipse=Ellipse(1.204, 0.8, 35.4))
    page = written(refused(pair, verdict=replace(ACCEPTED, accuracy=accuracy)), tmp_path)
    assert page.numbers["Error ellipse (90 %)"] == "1.20 × 0.80 px longer at 35°"


@pytest.mark.parametrize(("ce90_px", "said"), [(0.6, "larger"), (3.0, "smaller")])
def test_how_residuals_compare_with_the_accuracy(
    pair: ImagePair, tmp_path: Path, ce90_px: float, said: str
) -> None:
    """Nine tenths of residuals of 0.61 px (RMSE) are within 0.93 px."""
    accuracy = replace(ACCEPTED.accuracy, ce90_px=ce90_px)
    page = written(refused(pair, verdict=replace(ACCEPTED, accuracy=accuracy)), tmp_path)
    assert re.findall("Residuals of check points are ([a-z]+)", page.text) == [said]


def test_a_covered_overlap_is_not_said_to_be_extrapolated(pair: ImagePair, tmp_path: Path) -> None:
    verdict = replace(ACCEPTED, extrapolated_share=0.0)
    page = written(refused(pair, verdict=verdict), tmp_path)
    assert "surround the whole overlap" in page.text
    assert "lies outside" not in page.text


@pytest.mark.parametrize(
    ("log10_chance", "shown"),
    [(-math.inf, "< 1 in 10300"), (-3.4, "1 in 103"), (-0.5, "32 %"), (0.0, "100 %")],
)
def test_how_chance_is_said(
    pair: ImagePair, tmp_path: Path, log10_chance: float, shown: str
) -> None:
    verdict = replace(ACCEPTED, log10_chance=log10_chance)
    page = written(refused(pair, verdict=verdict), tmp_path)
    assert page.numbers["Agreement by chance"] == shown


def test_the_correction_is_the_injected_shift(page: Page) -> None:
    length = np.hypot(7, 4)
    assert f"moves the input by {length:.1f} px ({10 * length:.1f} m) at the centre" in page.text
    assert "the same over the grid" in page.text


def test_the_correction_is_the_first_line_with_its_direction(
    page: Page, pair: ImagePair, tmp_path: Path
) -> None:
    (line,) = [e for e in page.all("p") if e.attributes.get("class") == "correction"]
    # The input's georeferencing puts its ground 70 m too far east and 40 m too far north.
    assert "at the centre: 70.0 m west, 40.0 m south;" in " ".join(line.text.split())
    paragraphs = [e.attributes.get("class") for e in page.all("p")]
    assert paragraphs.index("correction") == paragraphs.index("reason") - 1
    changes = {"transform": transform_of(pair), "points": None}
    refusal = written(refused(pair, **changes), tmp_path)
    assert "The refused transform moves the input by" in refusal.text


@pytest.mark.parametrize("georeferenced", [True, False])
def test_rotation_and_scale_are_those_of_the_transform(
    pair: ImagePair, ungeoreferenced: ImagePair, georeferenced: bool
) -> None:
    """The input is shown turned by 2° clockwise and 3 % too large: the correction undoes that."""
    grid = (pair if georeferenced else ungeoreferenced).grid
    up = 1 if georeferenced else -1  # of y
    angle = np.deg2rad(-2 * up)
    linear = 1.03 * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    xy = grid.pixel_to_map(np.random.default_rng(0).uniform(0, 50, (20, 2)))
    model = fit_model("affine", xy, (xy - xy.mean(axis=0)) @ linear.T + xy.mean(axis=0))
    found = Correction.of(Transform(model, grid.crs, grid), grid)
    assert found.rotation_deg == pytest.approx(2, abs=1e-6)
    assert found.scale == pytest.approx(1 / 1.03, rel=1e-6)
    assert "rotated by 2.00° anticlockwise, scaled by 0.9709" in found.text()


def test_metres_in_degrees_are_those_along_each_axis() -> None:
    """At 60° north a degree of longitude has 55,800 m, one of latitude 111,412 m (WGS 84)."""
    grid = Grid(Affine(1e-4, 0, 9, 0, -1e-4, 60.005), CRS.from_epsg(4326), 100, 100)
    found = Correction.of(Transform(shift_model(-6e-4, -4e-4), grid.crs, grid), grid)
    assert found.direction == "33.5 m east, 44.6 m north"
    assert f"7.2 px ({math.hypot(33.48, 44.56):.1f} m) at the centre" in found.text()


def test_the_direction_where_x_leads_west_and_y_south() -> None:
    grid = Grid(Affine(-1, 0, 50, 0, 1, 3_320_000), CRS.from_epsg(2048), 100, 100)
    found = Correction.of(Transform(shift_model(-3.0, 4.0), grid.crs, grid), grid)
    assert found.direction == "3.0 m west, 4.0 m north"


def test_the_direction_without_georeferencing(ungeoreferenced: ImagePair) -> None:
    transform = transform_of(ungeoreferenced, np.array([7.0, -4.0]))
    assert Correction.of(transform, ungeoreferenced.grid).direction == "7.0 px left, 4.0 px down"
    # Where larger pixels are matched, all lengths are in these.
    coarse = Correction.of(transform, ungeoreferenced.grid.scaled(2.0))
    assert coarse.centre_px == pytest.approx(np.hypot(3.5, 2.0))
    assert coarse.direction == "3.5 px left, 2.0 px down"
    nothing = Transform.nominal(None, ungeoreferenced.input.source.grid)
    assert Correction.of(nothing, ungeoreferenced.grid).direction == ""


def test_the_deciding_rule_and_its_advice_are_shown(pair: ImagePair, tmp_path: Path) -> None:
    verdict = replace(
        Verdict(False, "the overlap is small"), rule="overlap", advice="try a <larger> input."
    )
    page = written(refused(pair, verdict=verdict), tmp_path)
    assert "The overlap is small." in page.text
    assert "What to try next: try a <larger> input." in page.text
    assert "Deciding rule: overlap" in page.text
    numbers = numbers_in(tmp_path)["verdict"]
    assert (numbers["rule"], numbers["advice"]) == ("overlap", "try a <larger> input.")


def test_facts_about_the_images(pair: ImagePair, tmp_path: Path) -> None:
    page = written(refused(pair, scene={"reference": "radar, 1 look", "urban": None}), tmp_path)
    assert "The images" in [e.text for e in page.all("h2")]
    assert {"radar, 1 look", "–"} <= {e.text for e in page.all("td")}
    assert numbers_in(tmp_path)["scene"] == {"sensors": "cameras"}


def test_what_was_tried_before(pair: ImagePair, tmp_path: Path) -> None:
    page = written(refused(pair, tried=("chips: refused", "<keypoints>: refused")), tmp_path)
    assert "What was tried" in [e.text for e in page.all("h2")]
    assert [e.text for e in page.all("li")] == ["chips: refused", "<keypoints>: refused"]
    assert numbers_in(tmp_path)["tried"] == ["chips: refused", "<keypoints>: refused"]


@pytest.mark.slow
def test_what_is_masked_is_shown_with_a_tint(pair: ImagePair, tmp_path: Path) -> None:
    keep = np.ones((120, 160), np.uint8)
    keep[:, :80] = 0
    mask = write_raster(tmp_path / "mask.tif", keep, GRID)
    with open_raster(mask) as source:
        masked = replace(pair, reference=replace(pair.reference, mask=source))
        page = written(report_of(masked), tmp_path)
    plain = picture(written(report_of(pair), tmp_path), "Overview of the reference")
    # The image is shown whole; the tint lies over it, and can be switched off.
    np.testing.assert_array_equal(picture(page, "Overview of the reference"), plain)
    (tint,) = [e for e in page.all("img") if e.attributes.get("class") == "mask"]
    data = base64.b64decode(str(tint.attributes["src"]).partition(",")[2])
    drawn = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert (drawn[:, :80, 3] > 0).all() and (drawn[:, :80, 3] < 128).all()
    assert not drawn[:, 80:, 3].any()
    # Magenta: less green than red.
    assert (drawn[:, :80, 1] < drawn[:, :80, 2]).all()
    (switch,) = [e for e in page.all("input") if e.attributes.get("name") == "mask"]
    assert switch.attributes["type"] == "checkbox"
    assert '[data-mask="hidden"] .mask { display: none; }' in page.all("style")[0].text
    assert "purple tint: masked" in page.text


def test_without_a_mask_there_is_nothing_to_switch_off(page: Page) -> None:
    assert not [e for e in page.all("input") if e.attributes.get("name") == "mask"]
    assert "purple tint" not in page.text


def test_chips_at_full_resolution_show_the_same_place_before_and_after(
    pair: ImagePair, page: Page
) -> None:
    side = min(SIDE_PX, pair.grid.width, pair.grid.height)
    labels = ["Best check point", "Worst check point", "Upper left corner", "Lower right corner"]
    for label in labels:
        chips = [e for e in page.all("img") if str(e.attributes["alt"]).startswith(f"{label}: ")]
        names = [str(e.attributes["alt"]).partition(": ")[2] for e in chips]
        assert names[:3] == ["reference", "input before", "input after"]
        reference, before, after = (
            picture_of(str(e.attributes["src"]), "image/jpeg").astype(float) for e in chips[:3]
        )
        assert reference.shape[:2] == (side, side)
        inner = slice(20, -20), slice(20, -20)
        alike = [
            np.corrcoef(reference[inner].ravel(), other[inner].ravel())[0, 1]
            for other in (before, after)
        ]
        # The images are waves of 40 px; the input lies 7 px and 4 px off before.
        assert alike[1] > 0.9 > alike[0]


def test_without_a_transform_there_are_no_chips(pair: ImagePair, tmp_path: Path) -> None:
    assert "At full resolution" not in written(refused(pair), tmp_path).text


def test_the_page_has_colours_for_the_dark(page: Page) -> None:
    style = page.all("style")[0].text
    assert "@media (prefers-color-scheme: dark)" in style
    light, dark = (part.partition("}")[0] for part in style.split(":root {")[1:3])
    defined = re.findall(r"(--[a-z]+):", light)
    assert defined and defined == re.findall(r"(--[a-z]+):", dark)


def test_pictures_before_and_after(page: Page) -> None:
    reference = picture(page, "Overview of the reference image reference.tif").astype(float)
    nominal = picture(page, "Overview of the input image input.tif at its nominal").astype(float)
    registered = picture(page, "Overview of the input image input.tif as registered").astype(float)
    inside = np.s_[15:-15, 15:-15]
    assert reference.shape == nominal.shape == registered.shape == (120, 160)

    def likeness(image: np.ndarray) -> float:
        return float(np.corrcoef(image[inside].ravel(), reference[inside].ravel())[0, 1])

    assert likeness(registered) > 0.99
    assert likeness(nominal) < 0.9


def test_the_viewer_can_be_used_by_keyboard(page: Page) -> None:
    inputs = page.all("input")
    kinds = [(e.attributes["type"], e.attributes.get("name")) for e in inputs]
    assert kinds == [("range", None), *[("radio", "mode")] * 3, *[("radio", "state")] * 2]
    (viewer,) = [e for e in page.all("figure") if e.attributes.get("class") == "viewer"]
    checked = {
        e.attributes["name"]: e.attributes["value"] for e in inputs if "checked" in e.attributes
    }
    # Every state that can be chosen has its style.
    assert checked == {
        "mode": viewer.attributes["data-mode"],
        "state": viewer.attributes["data-state"],
    }
    style = page.all("style")[0].text
    for name in ("mode", "state"):
        values = [e.attributes["value"] for e in inputs if e.attributes.get("name") == name]
        assert all(f'[data-{name}="{value}"]' in style for value in values)


def test_figures_of_errors(page: Page) -> None:
    alts = [str(e.attributes["alt"]) for e in page.all("img")]
    assert any("11 of 12 points used in the fit, 8 of 9 check points agree" in a for a in alts)
    assert any(a.startswith("Histogram") and "RMSE 0.61 px" in a for a in alts)
    assert any("a circle that holds 90 % of them" in a for a in alts)
    # The figures reach to 3 px; one check point is 12.5 px off.
    assert "the 9 check points that were matched" in page.text
    assert "Not in either figure: 1 of more than 3.0 px." in page.text


def test_surfaces_show_their_peaks(page: Page) -> None:
    assert picture(page, "Similarity surface: best check point").shape == (17, 17, 3)
    peaks = [e.attributes for e in page.all("circle") if e.attributes.get("class") == "peak"]
    # Pixel (col, row) = (8 + 1, 8 - 2) has its centre half a pixel further.
    assert [(p["cx"], p["cy"]) for p in peaks] == [("9.50", "6.50"), ("14.50", "11.50")]
    assert "± 8 px; peak 9.0 σ at (1.0, -2.0) px" in page.text


def test_each_side_of_the_line_is_named(page: Page) -> None:
    """The names stand in the picture and are cut off with what they name."""
    names = {e.attributes["class"]: e.text.strip() for e in page.all("span") if e.text.strip()}
    assert names["side reference"] == "Reference"
    assert names["side input"] == "Input"
    style = page.all("style")[0].text
    assert ".side.reference { clip-path: inset(0 calc(100% - var(--at) * 1%) 0 0); }" in style
    assert '[data-mode="swipe"] .input { clip-path: inset(0 0 0 calc(var(--at) * 1%)); }' in style
