from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from groundtie.matching.local import LocalSearch
from groundtie.matching.rough import RoughSearch
from textured_pairs import TexturedPair, error_px, listing

from groundtie.errors import NotRegisteredError, OutputError, SameFileError
from groundtie.geometry.transform import load_transform
from groundtie.matching.layout import lay_out_chips
from groundtie.progress import SILENT
from groundtie.rasters.pair import ImagePair
from groundtie.registration.registration import (
    Registration,
    RegistrationFiles,
    RegistrationResult,
    accepted_or_refused,
    refuse_what_roofs_may_be,
    register,
)
from groundtie.registration.verdict import refuse
from groundtie.report.report import Report
from groundtie.similarity.surface import SimilaritySettings


@pytest.fixture(scope="module")
def pair(textured: TexturedPair) -> Iterator[ImagePair]:
    with textured.opened() as opened:
        yield opened


@pytest.fixture(scope="module")
def registration(pair: ImagePair) -> Registration:
    search = LocalSearch(pair, lay_out_chips(pair), SimilaritySettings("orientation"))
    with ThreadPoolExecutor(2) as executor:
        return register(pair, search, RoughSearch(200.0), "auto", 3.0, 0, executor, SILENT)


def report_of(registration: Registration) -> Report:
    return Report(
        title="title",
        verdict=registration.verdict,
        pair=registration.pair,
        points=registration.points,
        transform=registration.transform,
        surfaces=(),
        parameters={},
        seconds=1.0,
    )


def refused(registration: Registration) -> Registration:
    return replace(registration, estimate=None, check=None, verdict=refuse("nothing in common"))


def test_a_registration_has_a_transform_points_and_a_verdict(
    registration: Registration, textured: TexturedPair
) -> None:
    assert registration.verdict.accepted
    points, transform = registration.accepted()
    assert error_px(transform, textured) < 0.3
    # Points of the fit first, then check points.
    assert (np.diff(points.is_check.astype(int)) >= 0).all()
    assert points.is_check.sum() == registration.verdict.check_points
    # No check point lies among the pixels that the fit saw.
    px = textured.grid.map_to_pixel(points.reference_xy)
    held_out = registration.search.layout.held_out(px)
    np.testing.assert_array_equal(held_out, points.is_check)


def test_surfaces_of_the_best_and_worst_check_points(registration: Registration) -> None:
    surfaces = registration.extreme_surfaces()
    labels = [label for label, _ in surfaces]
    best, worst = labels.count("best check point"), labels.count("worst check point")
    assert best + worst == len(labels)
    assert best == 3
    assert 0 < worst <= 3
    side = 2 * registration.search.check_radius_px + 1
    for _, surface in surfaces:
        assert surface.shape == (side, side)
        assert np.isfinite(surface).all()
    assert refused(registration).extreme_surfaces() == ()


def test_few_check_points_are_shown_once(registration: Registration) -> None:
    assert registration.check is not None
    few = replace(registration, check=registration.check.take(slice(0, 4)))
    labels = [label for label, _ in few.extreme_surfaces()]
    assert labels == ["best check point"] * 3 + ["worst check point"]
    none = replace(registration, check=registration.check.take(slice(0, 0)))
    assert none.extreme_surfaces() == ()


def test_files_of_an_accepted_registration(registration: Registration, tmp_path: Path) -> None:
    files = RegistrationFiles(tmp_path / "p.csv", tmp_path / "t.json", tmp_path / "r.html")
    with accepted_or_refused(registration, report_of(registration), files) as outputs:
        files.write_points(*registration.accepted(), outputs)
        assert not (tmp_path / "t.json").exists()
    assert set(listing(tmp_path)) == {"p.csv", "t.json", "r.html", "r.json"}
    points, transform = registration.accepted()
    np.testing.assert_array_equal(
        load_transform(tmp_path / "t.json")(points.reference_xy), transform(points.reference_xy)
    )
    assert set(files.written()) == {"tie_points", "transform", "report"}
    assert RegistrationFiles(None, None, None).written() == {}


def test_a_refused_registration_writes_its_report_and_raises(
    registration: Registration, tmp_path: Path
) -> None:
    files = RegistrationFiles(tmp_path / "p.csv", tmp_path / "t.json", tmp_path / "r.html")
    lost = refused(registration)
    with (
        pytest.raises(
            NotRegisteredError, match=r"input\.tif was not .*: nothing in common"
        ) as error,
        accepted_or_refused(lost, report_of(lost), files),
    ):
        pytest.fail("a refused registration has no outputs")
    assert error.value.verdict is lost.verdict
    assert set(listing(tmp_path)) == {"r.html", "r.json"}
    numbers = json.loads((tmp_path / "r.json").read_text())
    assert numbers["verdict"]["accepted"] is False
    with (
        pytest.raises(NotRegisteredError),
        accepted_or_refused(lost, report_of(lost), RegistrationFiles(None, None, None)),
    ):
        pytest.fail("a refused registration has no outputs")


def test_what_fails_later_leaves_no_report_either(
    registration: Registration, tmp_path: Path
) -> None:
    files = RegistrationFiles(None, tmp_path / "t.json", tmp_path / "r.html")
    with (
        pytest.raises(OutputError),
        accepted_or_refused(registration, report_of(registration), files) as outputs,
    ):
        files.write_points(*registration.accepted(), outputs)
        raise OutputError("the disk is full")
    assert listing(tmp_path) == {}


def test_the_report_and_the_transform_cannot_share_a_name() -> None:
    """A report's numbers are put beside it as JSON; nothing is computed before this is found."""
    with pytest.raises(SameFileError, match=r"report's numbers: .*r\.json"):
        RegistrationFiles(None, Path("r.json"), Path("r.html"))


def test_a_result_is_lines_for_people_and_json_for_programs(registration: Registration) -> None:
    numbers = report_of(registration).summary()
    result = RegistrationResult.of(registration, numbers, {"output": Path("out.tif")})
    summary = json.loads(json.dumps(result.summary(), allow_nan=False))
    assert summary["files"] == {"output": "out.tif"}
    assert summary["verdict"] == registration.verdict.summary()
    lines = result.lines()
    verdict = registration.verdict
    assert lines[0] == "accepted: check points confirm the registration"
    assert f"{verdict.fit_points_used} of {verdict.fit_points} points" in lines[1]
    assert f"{verdict.check_points_agreeing} of {verdict.check_points}" in lines[3]
    assert lines[-1] == "output: out.tif"
    # 10 m pixels, as both units say.
    assert f"RMSE {verdict.check_rmse_px:.2f} px ({10 * verdict.check_rmse_px:.2f} m)" in lines[2]


@pytest.mark.parametrize(
    ("agreeing", "is_town", "accepted"),
    [(11, True, False), (11, False, True), (18, True, True)],
)
def test_few_who_agree_are_not_enough_where_roofs_may(
    registration: Registration, agreeing: int, is_town: bool, accepted: bool
) -> None:
    verdict = replace(registration.verdict, check_points=25, check_points_agreeing=agreeing)
    given = replace(registration, verdict=verdict)
    judged = refuse_what_roofs_may_be(given, lambda: False, lambda: is_town)
    assert judged.verdict.accepted == accepted
    assert accepted or "only 11 of 25 check points agree" in judged.verdict.reason


def test_a_town_is_looked_for_only_where_it_matters(registration: Registration) -> None:
    def look() -> bool:
        raise AssertionError("both images would be read for nothing")

    many = replace(registration.verdict, check_points=25, check_points_agreeing=24)
    clear, lost = replace(registration, verdict=many), refused(registration)
    assert refuse_what_roofs_may_be(clear, lambda: False, look) is clear
    assert refuse_what_roofs_may_be(lost, look, look) is lost


def test_ground_that_is_not_found_for_sure_confirms_nothing(registration: Registration) -> None:
    judged = refuse_what_roofs_may_be(registration, lambda: True, lambda: False)
    assert registration.verdict.accepted and not judged.verdict.accepted
    assert "has no speckle" in judged.verdict.reason
