from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import pytest
from brightness_classifiers import bright_is_left_out
from raster_files import write_raster
from rasterio.crs import CRS
from speckled_pairs import write_speckled_pair
from textured_pairs import TexturedPair, listing, pixels, shift_on_map

from groundtie import detector_repeatability
from groundtie.errors import NoOverlapError, OutputError, ParameterError
from groundtie.geometry.models import shift_model
from groundtie.geometry.transform import Transform
from groundtie.rasters.reading import open_raster

SIZE = (260, 240)


@pytest.fixture(scope="module")
def registered(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    folder = tmp_path_factory.mktemp("registered")
    return write_speckled_pair(folder, SIZE, shift_on_map(0.0, 0.0))


@pytest.mark.slow
def test_all_variants_are_compared(registered: TexturedPair, tmp_path: Path) -> None:
    names = ["sift", "sift-oct", "sift-oct+roewa+oriented"]
    found = detector_repeatability(
        registered.reference,
        registered.input,
        tmp_path / "table.csv",
        variants=", ".join(names),
        picture=tmp_path / "picture.png",
        numbers=tmp_path / "numbers.json",
    )
    sift, oct, turning = found.evaluations
    assert [one.variant for one in found.evaluations] == [
        "sift",
        "sift-oct",
        "sift-oct+roewa+oriented",
    ]
    assert sift.detections[0] > 2 * oct.detections[0] > 100
    assert turning.detections == oct.detections
    # Registered: what matches well overlaps well, and filtering leaves what does.
    assert oct.filtered.by_class[:2].sum() > 0.8 * oct.filtered.matches > 20
    assert max(oct.filtered.std_px) < 1.5
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["variant"] for row in rows] == [one.variant for one in found.evaluations]
    assert int(rows[1]["filtered"]) == oct.filtered.matches
    assert float(rows[1]["repeatability_0_10"]) == pytest.approx(oct.repeated[0], abs=1e-4)
    numbers = json.loads((tmp_path / "numbers.json").read_text())
    assert numbers["variants"][0]["detections"] == list(sift.detections)
    assert cv2.imread(str(tmp_path / "picture.png")).shape[2] == 3
    assert "features" in found.lines()[0]


def test_a_transform_registers_the_input(tmp_path: Path, registered: TexturedPair) -> None:
    moved = write_speckled_pair(tmp_path, SIZE, shift_on_map(70.0, -45.0))
    path = tmp_path / "truth.json"
    path.write_text(json.dumps(moved.truth.to_json()))
    with_it, without = (
        detector_repeatability(
            moved.reference, moved.input, tmp_path / "t.csv", variants="sift-oct", transform=given
        ).evaluations[0]
        for given in (path, None)
    )
    assert with_it.repeated[0] > 3 * without.repeated[0]


@pytest.mark.parametrize("epsg", [4326, 32631])
def test_a_transform_may_be_of_another_map(
    tmp_path: Path, registered: TexturedPair, epsg: int
) -> None:
    """Its positions were taken for the reference's: nothing was found, and nothing said."""
    with open_raster(registered.input) as source:
        other = Transform.nominal(CRS.from_epsg(epsg), source.grid)
    path = tmp_path / "other.json"
    path.write_text(json.dumps(other.to_json()))
    same, without = (
        detector_repeatability(
            registered.reference,
            registered.input,
            tmp_path / "t.csv",
            variants="sift-oct",
            transform=given,
        ).evaluations[0]
        for given in (path, None)
    )
    assert same.detections == pytest.approx(without.detections, rel=0.02)
    assert same.repeated[0] == pytest.approx(without.repeated[0], abs=0.02)


def test_nothing_that_both_show(tmp_path: Path, registered: TexturedPair) -> None:
    with open_raster(registered.input) as source:
        far = Transform(shift_model(1e6, 0.0), source.grid.crs, source.grid)
    path = tmp_path / "far.json"
    path.write_text(json.dumps(far.to_json()))
    with pytest.raises(NoOverlapError, match="they show nothing together"):
        detector_repeatability(
            registered.reference, registered.input, tmp_path / "t.csv", transform=path
        )
    assert list(listing(tmp_path)) == ["far.json"]


def test_the_middle_of_a_large_overlap_is_looked_at(
    registered: TexturedPair, tmp_path: Path
) -> None:
    whole, part = (
        detector_repeatability(
            registered.reference, registered.input, tmp_path / "t.csv", variants="sift", size=size
        ).evaluations[0]
        for size in (2000, 120)
    )
    share = 120**2 / (SIZE[0] * SIZE[1])
    assert part.detections[0] == pytest.approx(share * whole.detections[0], rel=0.3)


@pytest.mark.slow
def test_features_that_a_classifier_leaves_out_are_not_counted(
    registered: TexturedPair, tmp_path: Path
) -> None:
    typical = float(pixels(registered.input)[0].mean())
    for limit, share in ((0.01 * typical, 0.0), (10 * typical, 1.0)):
        classifier = bright_is_left_out(tmp_path / "c.json", limit)
        whole, left = (
            detector_repeatability(
                registered.reference,
                registered.input,
                tmp_path / "t.csv",
                variants="sift-oct",
                input_mask=chosen,
            ).evaluations[0]
            for chosen in (None, classifier)
        )
        assert left.detections == (whole.detections[0], share * whole.detections[1])


@pytest.mark.slow
def test_images_without_features_have_a_table_of_zeros(
    registered: TexturedPair, tmp_path: Path
) -> None:
    flat = write_raster(tmp_path / "flat.tif", pixels(registered.input)[0] * 0 + 7, registered.grid)
    found = detector_repeatability(
        registered.reference, flat, tmp_path / "t.csv", picture=tmp_path / "p.png"
    )
    assert all(one.detections[1] == one.matched.matches == 0 for one in found.evaluations)


@pytest.mark.parametrize("variants", ["sift,surf", "sift,sift", ""])
def test_bad_variants_leave_nothing(
    registered: TexturedPair, tmp_path: Path, variants: str
) -> None:
    with pytest.raises(ParameterError, match="variant"):
        detector_repeatability(
            registered.reference, registered.input, tmp_path / "t.csv", variants=variants
        )
    assert not listing(tmp_path)


def test_an_output_folder_must_exist(registered: TexturedPair, tmp_path: Path) -> None:
    with pytest.raises(OutputError):
        detector_repeatability(registered.reference, registered.input, tmp_path / "no" / "t.csv")
