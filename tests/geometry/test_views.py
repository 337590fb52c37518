from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from groundtie.errors import ParameterError
from groundtie.geometry.views import View, files_beside, parse_view, read_view, split_views

STAC = {
    "view:azimuth": 100.0,
    "view:off_nadir": 20.0,
    "view:incidence_angle": 22.0,
    "view:sun_azimuth": 155.0,
    "view:sun_elevation": 48.0,
}


def item(path: Path, properties: dict[str, object]) -> Path:
    path.write_text(json.dumps({"type": "Feature", "properties": properties}), encoding="utf-8")
    return path


def test_words() -> None:
    assert parse_view("radar azimuth=280 incidence=35.5") == View("radar", 280.0, 35.5)
    words = "Camera azimuth=250°, incidence=12, sun-azimuth=155, sun-elevation=48°"
    assert parse_view(words) == View("camera", 250.0, 12.0, 155.0, 48.0)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (None, (None, None)),
        ("a.json", ("a.json", None)),
        ("; camera azimuth=1", (None, "camera azimuth=1")),
        ("a.json;b.json", ("a.json", "b.json")),
    ],
)
def test_the_references_view_stands_first(
    words: str | None, expected: tuple[str | None, str | None]
) -> None:
    assert split_views(words) == expected


def test_a_pair_has_two_views() -> None:
    with pytest.raises(ParameterError, match="states 3 views"):
        split_views("a.json; b.json; c.json")


def test_an_items_azimuth_points_from_the_sensor_to_the_ground(tmp_path: Path) -> None:
    assert read_view(item(tmp_path / "a.json", STAC)) == View("camera", 280.0, 22.0, 155.0, 48.0)


def test_an_item_with_properties_of_a_sar_is_a_radars_and_has_no_sun(tmp_path: Path) -> None:
    radar = {**STAC, "view:azimuth": 270.0, "sar:frequency_band": "X"}
    assert read_view(item(tmp_path / "a.json", radar)) == View("radar", 90.0, 22.0)


@pytest.mark.parametrize("height_km", [500, 600, 770])
@pytest.mark.parametrize("off_nadir", [0.0, 12.0, 20.0, 30.0])
def test_an_incidence_angle_follows_from_the_angle_off_nadir(
    tmp_path: Path, off_nadir: float, height_km: float
) -> None:
    # Where the line of sight meets a sphere, from a satellite on the axis of z.
    earth_km, along = 6371.0, np.deg2rad(off_nadir)
    sensor, sight = np.array([0, earth_km + height_km]), np.array([np.sin(along), -np.cos(along)])
    middle = -sensor @ sight
    ground = sensor + (middle - np.sqrt(middle**2 - sensor @ sensor + earth_km**2)) * sight
    expected = np.rad2deg(np.arccos(-sight @ ground / earth_km))

    values = {"view:azimuth": 100.0, "view:off_nadir": off_nadir}
    view = read_view(item(tmp_path / "a.json", values))
    assert view.incidence_deg == pytest.approx(expected, abs=1e-9 if height_km == 600 else 1.0)


def test_an_angle_off_nadir_that_misses_the_earth_is_no_view(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="must be 0 to 80"):
        read_view(item(tmp_path / "a.json", {"view:azimuth": 100.0, "view:off_nadir": 80.0}))


@pytest.mark.parametrize("name", [".", "/", "a" * 250 + ".tif", "a" * 300 + ".tif"])
def test_nothing_lies_beside_a_name_that_no_file_can_have(name: str) -> None:
    assert View.of(name, None) is None
    assert list(files_beside(Path(name))) == []


def test_the_item_beside_an_image_is_found(tmp_path: Path) -> None:
    image = tmp_path / "scene.tif"
    assert View.of(image, None) is None
    item(tmp_path / "scene.json", {"verdict": {"accepted": True}})
    assert View.of(image, None) is None, "a report is no item"
    item(tmp_path / "scene.json", STAC)
    assert View.of(image, None) == View("camera", 280.0, 22.0, 155.0, 48.0)
    assert View.of(image, "radar azimuth=90 incidence=40") == View("radar", 90.0, 40.0)
    assert View.of(object(), None) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "states no view"),
        ("azimuth=3 incidence=4", "states no view"),
        ("radar azimuth=a incidence=4", "states no view"),
        ("radar azimuth=3 incidence=4 azimuth=5", "states an angle twice"),
        ("radar azimuth=3", "does not state incidence"),
        ("radar azimuth=3 incidence=2", "must be 5 to 80"),
        ("camera azimuth=3 incidence=85", "must be 0 to 80"),
        ("camera azimuth=3 incidence=5 tilt=3", "there is no tilt"),
        ("camera azimuth=3 incidence=5 sun-azimuth=20", "does not state sun-elevation"),
        ("camera azimuth=3 incidence=5 sun-azimuth=20 sun-elevation=-3", "must be 1 to 90"),
    ],
)
def test_words_that_state_no_view(text: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        parse_view(text)


@pytest.mark.parametrize(
    "content", ["[]", "{", '{"properties": {}}', '{"properties": {"view:azimuth": "x"}}', "3"]
)
def test_files_that_state_no_view(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ParameterError):
        View.of(tmp_path / "a.tif", str(path))


def test_a_file_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="cannot read the view"):
        read_view(tmp_path / "a.json")
