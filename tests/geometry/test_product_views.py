"""Views in the metadata of products: made as the products' specifications have them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from groundtie.errors import ParameterError
from groundtie.geometry.views import View, stated_view

SENTINEL_1 = """<product><generalAnnotation><productInformation><pass>Descending</pass>
<platformHeading>-1.680000e+02</platformHeading></productInformation></generalAnnotation>
<imageAnnotation><imageInformation><incidenceAngleMidSwath>3.9e+01</incidenceAngleMidSwath>
</imageInformation></imageAnnotation></product>"""
TERRASAR_X = """<level1Product><productInfo><acquisitionInfo><lookDirection>RIGHT</lookDirection>
</acquisitionInfo><sceneInfo><sceneCenterCoord><lat>48.15</lat><lon>11.58</lon>
<incidenceAngle>35.5</incidenceAngle></sceneCenterCoord><headingAngle>350.5</headingAngle>
</sceneInfo></productInfo></level1Product>"""
ICEYE = """<Metadata><look_side>left</look_side><orbit_direction>ASCENDING</orbit_direction>
<incidence_center>29.5</incidence_center><heading>347.0</heading></Metadata>"""
MAXAR = """<isd><IMD><IMAGE><SATID>WV03</SATID><MEANSUNAZ>151.3</MEANSUNAZ>
<MEANSUNEL>62.7</MEANSUNEL><MEANSATAZ>24.1</MEANSATAZ><MEANSATEL>77.0</MEANSATEL></IMAGE></IMD></isd>"""
IMD = """BEGIN_GROUP = IMAGE_1
\tsatId = "WV03";
\tmeanSunAz = 151.3;
\tmeanSunEl = 62.7;
\tmeanSatAz = 24.1;
\tmeanSatEl = 77.0;
END_GROUP = IMAGE_1
END;
"""
UMBRA = {
    "vendor": "Umbra Space",
    "collects": [
        {
            "angleAzimuthDegrees": 122.1,
            "angleIncidenceDegrees": 47.4,
            "satelliteTrack": "ASCENDING",
            "observationDirection": "LEFT",
        }
    ],
}


def capella(sensor: tuple[float, float, float]) -> str:
    """Metadata of a place on the equator at 0° E, seen from a position; others are farther on."""
    states = [{"position": position} for position in ((0, 0, 0), sensor, (0, 0, 0))]
    image = {"center_pixel": {"incidence_angle": 38.0, "target_position": [6378137.0, 0.0, 0.0]}}
    return json.dumps({"collect": {"image": image, "state": {"state_vectors": states}}})


CAMERA = View("camera", 24.1, 13.0, 151.3, 62.7)


@pytest.mark.parametrize(
    ("image", "metadata", "content", "expected"),
    [
        # Flies south-south-west, looks to the right: north-west; so it stands in the east.
        ("measurement/a.tiff", "annotation/a.xml", SENTINEL_1, View("radar", 102.0, 39.0)),
        ("p/IMAGEDATA/IMAGE_HH.tif", "p/p.xml", TERRASAR_X, View("radar", 260.5, 35.5)),
        ("ICEYE_GRD.tif", "ICEYE_GRD.xml", ICEYE, View("radar", 77.0, 29.5)),
        ("scene.TIF", "scene.XML", MAXAR, CAMERA),
        ("scene.TIF", "scene.IMD", IMD, CAMERA),
        ("b_GEC.tif", "b_METADATA.json", json.dumps(UMBRA), View("radar", 122.1, 47.4)),
        # At the equator at 0° E the axis y of geocentric positions points east, z north.
        ("c.tif", "c_extended.json", capella((6.9e6, 0.4e6, 0.0)), View("radar", 90.0, 38.0)),
        ("c.tif", "c_extended.json", capella((6.9e6, 0.0, -0.4e6)), View("radar", 180.0, 38.0)),
    ],
)
def test_a_products_metadata_beside_an_image_state_its_view(
    tmp_path: Path, image: str, metadata: str, content: str, expected: View
) -> None:
    path = tmp_path / metadata
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content, encoding="utf-8")
    for found in (View.of(tmp_path / image, None), stated_view(str(path))):
        assert found is not None
        assert (found.sensor, found.incidence_deg) == (expected.sensor, expected.incidence_deg)
        assert found.azimuth_deg == pytest.approx(expected.azimuth_deg)
        assert found.sun_azimuth_deg == expected.sun_azimuth_deg
        assert found.sun_elevation_deg == expected.sun_elevation_deg


def test_a_view_in_the_north_is_one_of_the_ellipsoids_normal(tmp_path: Path) -> None:
    # 45° N, 0° E on the ellipsoid; what lies along the normal has no azimuth, 1 m north has 0°.
    ground, normal = (4517590.879, 0.0, 4487348.409), (0.5**0.5, 0.0, 0.5**0.5)
    north = (-(0.5**0.5), 0.0, 0.5**0.5)
    sensor = [g + 5e5 * up + 1e3 * n for g, up, n in zip(ground, normal, north, strict=True)]
    content = json.loads(capella((0, 0, 0)))
    content["collect"]["image"]["center_pixel"]["target_position"] = ground
    content["collect"]["state"]["state_vectors"] = [{"position": sensor}]
    path = tmp_path / "c_extended.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    assert stated_view(str(path)).azimuth_deg == pytest.approx(0.0, abs=1e-6)


def test_what_states_no_view_is_no_metadata(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text("<PAMDataset/>", encoding="utf-8")
    assert View.of(tmp_path / "a.tif", None) is None
    (tmp_path / "a.xml").write_text("<PAMDataset", encoding="utf-8")
    assert View.of(tmp_path / "a.tif", None) is None


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.xml", "<product", "cannot read the view"),
        ("a.xml", "<x><incidence_center>30</incidence_center></x>", "it lacks 'heading'"),
        ("a.xml", ICEYE.replace("left", "down"), "does not look to the 'down'"),
        ("a.xml", ICEYE.replace("29.5", "95"), "incidence must be 5 to 80"),
        ("a.imd", "meanSatAz = 1;", "it lacks 'MEANSATEL'"),
        ("a.json", '{"collect": {"image": {}}}', "it lacks 'center_pixel'"),
        ("a.xml", "<nothing/>", "cannot read the view"),
    ],
)
def test_metadata_that_were_given_must_state_a_view(
    tmp_path: Path, name: str, content: str, message: str
) -> None:
    (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(ParameterError, match=message):
        stated_view(str(tmp_path / name))
