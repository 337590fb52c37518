from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from rpc_models import DIMAP, REAL, camera_rpc, rasterio_project, real_tags, to_rasterio

from groundtie.errors import GeoreferencingError, OutputError
from groundtie.rasters.reading import open_raster
from groundtie.sensor.polynomials import EXPONENTS
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc, rpc_of, write_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags, rpc_to_tags

CAMERA = replace(camera_rpc(), error_bias_m=2.5, error_random_m=0.25)


def write_image(path: Path, rpc: RPC | None = None) -> Path:
    profile = {"driver": "GTiff", "width": 60, "height": 50, "count": 1, "dtype": "uint8"}
    with rasterio.open(path, "w", **profile) as dataset:
        dataset.write(np.ones((1, 50, 60), np.uint8))
        if rpc is not None:
            dataset.rpcs = to_rasterio(rpc)
    return path


def flat(rpc: RPC) -> np.ndarray:
    values = [getattr(rpc, field.name) for field in fields(rpc)]
    return np.concatenate([np.ravel(value).astype(float) for value in values if value is not None])


def assert_same(found: RPC, expected: RPC) -> None:
    # GDAL hands 15 digits on.
    np.testing.assert_allclose(flat(found), flat(expected), rtol=1e-14, atol=0)


@pytest.mark.parametrize("name", ["image_RPC.TXT", "image.RPB"])
def test_files_hold_every_digit_and_gdal_reads_them(tmp_path: Path, name: str) -> None:
    write_rpc(tmp_path / name, CAMERA)
    assert read_rpc(tmp_path / name) == CAMERA
    with open_raster(write_image(tmp_path / "image.tif"), allow_sensor_geometry=True) as source:
        assert_same(rpc_of(source), CAMERA)


def test_tags_of_an_image_are_read(tmp_path: Path) -> None:
    path = write_image(tmp_path / "image.tif", CAMERA)
    with open_raster(path, allow_sensor_geometry=True) as source:
        assert_same(rpc_of(source), CAMERA)


@pytest.mark.parametrize(("driver", "suffix"), [("JP2OpenJPEG", "jp2"), ("NITF", "ntf")])
def test_rpcs_inside_of_other_formats_are_read(tmp_path: Path, driver: str, suffix: str) -> None:
    path = tmp_path / f"other.{suffix}"
    rasterio.shutil.copy(write_image(tmp_path / "image.tif", CAMERA), path, driver=driver)
    for beside in tmp_path.glob("*.aux.xml"):
        beside.unlink()
    with rasterio.open(path) as dataset:
        expected = dataset.rpcs
    with open_raster(path, allow_sensor_geometry=True) as source:
        found = rpc_of(source)
    ground = np.array([[9.0, 45.15], [9.0002, 45.1501]])
    assert (
        np.abs(found.project(ground, 300.0) - rasterio_project(expected, ground, 300.0)).max()
        < 1e-6
    )


def test_a_file_replaces_the_tags(tmp_path: Path) -> None:
    path = write_image(tmp_path / "image.tif", CAMERA)
    write_rpc(tmp_path / "other_rpc.txt", CAMERA.shifted((5, 6)))
    with open_raster(path, allow_sensor_geometry=True) as source:
        assert rpc_of(source, tmp_path / "other_rpc.txt") == CAMERA.shifted((5, 6))


def test_errors_that_are_not_known_stay_so(tmp_path: Path) -> None:
    unknown = replace(CAMERA, error_bias_m=None, error_random_m=None)
    assert rpc_from_tags(rpc_to_tags(unknown), "x") == unknown
    write_rpc(tmp_path / "a.RPB", unknown)
    assert read_rpc(tmp_path / "a.RPB") == unknown


@pytest.mark.parametrize("name", REAL)
def test_real_tags_are_gdals(real_data: Path, name: str) -> None:
    with rasterio.open(real_data / name) as dataset:
        expected = dataset.rpcs
    rpc = rpc_from_tags(real_tags(real_data / name), name)
    ground = np.random.default_rng(0).uniform(-1, 1, (100, 3)) * rpc.scale + rpc.offset
    at_gdal = rasterio_project(expected, ground[:, :2], ground[:, 2])
    assert np.abs(rpc.project(ground[:, :2], ground[:, 2]) - at_gdal).max() < 1e-6


def test_dimap_agrees_with_the_physical_model(real_data: Path) -> None:
    """The grid counts from the first pixel's corner; its nodes are 0.5 beyond pixel 4000."""
    rpc = read_rpc(real_data / DIMAP)
    name = "rpc-ventoux/GRID_PHR1B_P_201308051042194_SEN_690908101-001.tif"
    with rasterio.open(real_data / name) as dataset:
        positions, t = dataset.read(), dataset.transform
        heights = [float(dataset.tags(ns="GTiff")[f"LG_ALTITUDE_B{k}"]) for k in range(10)]
    rows, cols = np.indices(positions.shape[1:])
    px = np.column_stack([(t.c + t.a * cols).ravel(), (t.f + t.e * rows).ravel()]) - 0.5
    for k in range(0, 10, 2):
        lon_lat = positions[k : k + 2].reshape(2, -1).T
        # The supplier states that the RPCs miss the model by 0.002 px.
        assert np.abs(rpc.project(lon_lat, heights[k]) - px).max() < 2e-3


# Terms of RPC00A as powers of longitude, latitude and height, in its order [NGA2000].
RPC00A = (
    *("", "L", "P", "H", "LP", "LH", "PH", "LPH", "LL", "PP", "HH"),
    *("LLL", "LLP", "LLH", "LPP", "PPP", "PPH", "LHH", "PHH", "HHH"),
)


def test_rpc00a_has_the_same_polynomials_in_another_order(tmp_path: Path) -> None:
    write_rpc(tmp_path / "b.rpb", CAMERA)
    # The value of each term at L, P, H: three primes tell the terms apart.
    at = {"L": 2.0, "P": 3.0, "H": 5.0}
    values = {term: np.prod([at[letter] for letter in term]) for term in RPC00A}
    number = monomials_at(2.0, 3.0, 5.0)
    places = [int(np.flatnonzero(np.isclose(number, values[term]))[0]) for term in RPC00A]
    assert sorted(places) == list(range(20))
    text = (tmp_path / "b.rpb").read_text().replace("RPC00B", "RPC00A")

    def reordered(match: re.Match[str]) -> str:
        words = [word.strip() for word in match[2].split(",")]
        return match[1] + "(" + ", ".join(words[place] for place in places) + ")"

    text = re.sub(r"(\w+Coef = )\(([^)]*)\)", reordered, text)
    (tmp_path / "a.rpb").write_text(text)
    assert read_rpc(tmp_path / "a.rpb") == CAMERA
    # GDAL finds such a file beside an image, too, but takes its terms for those of RPC00B.
    image = write_image(tmp_path / "a.tif")
    with open_raster(image, allow_sensor_geometry=True) as source:
        assert rpc_from_tags(source.tags["RPC"], "a") != CAMERA
        assert rpc_of(source) == CAMERA
    image = write_image(tmp_path / "b.tif")
    with open_raster(image, allow_sensor_geometry=True) as source:
        assert_same(rpc_of(source), CAMERA)
    # So it does in an archive.
    with ZipFile(tmp_path / "product.zip", "w") as product:
        for name in ("a.tif", "a.rpb", "b.tif", "b.rpb"):
            product.write(tmp_path / name, f"inner/{name}")
    for archive in (f"{tmp_path}/product.zip", f"{{{tmp_path}/product.zip}}"):
        for name in ("a.tif", "b.tif"):
            path = f"/vsizip/{archive}/inner/{name}"
            with open_raster(path, allow_sensor_geometry=True) as source:
                assert_same(rpc_of(source), CAMERA)


def monomials_at(lon: float, lat: float, height: float) -> np.ndarray:
    """Return the twenty terms in the order of RPC00B at a normalized place."""
    return np.prod(np.array([lon, lat, height]) ** np.array(EXPONENTS), axis=1)


@pytest.mark.parametrize("first", [0, 1])
def test_dimap_3_states_what_it_counts_from(tmp_path: Path, first: int) -> None:
    (tmp_path / "RPC.XML").write_text(dimap_3(CAMERA.shifted((first, first)), first, first))
    assert_same(read_rpc(tmp_path / "RPC.XML"), CAMERA)


@pytest.mark.parametrize(
    ("name", "is_whole"),
    [("IMG_PNEO_R1C1.TIF", True), ("IMG_PNEO.TIF", True), ("IMG_R1C2.TIF", False),
     ("img_r2c1.tif", False), ("IMG_R11C1.TIF", False)],
)  # fmt: skip
def test_the_rpcs_of_a_whole_image_are_not_those_of_its_tiles(
    tmp_path: Path, name: str, is_whole: bool
) -> None:
    """They would lie off by the tile's first row and column."""
    (tmp_path / "RPC.XML").write_text(dimap_3(CAMERA, 0, 0))
    write_rpc(tmp_path / "own_RPC.TXT", CAMERA)
    with open_raster(write_image(tmp_path / name, CAMERA), allow_sensor_geometry=True) as source:
        # A file of the tile's own.
        assert_same(rpc_of(source, tmp_path / "own_RPC.TXT"), CAMERA)
        if is_whole:
            assert_same(rpc_of(source, tmp_path / "RPC.XML"), CAMERA)
        else:
            with pytest.raises(GeoreferencingError, match=r"is a tile .*RPC\.XML .* beside"):
                rpc_of(source, tmp_path / "RPC.XML")


def test_dimap_3_that_counts_from_anywhere_is_refused(tmp_path: Path) -> None:
    for firsts in ((0, 1), (-27, -791)):
        (tmp_path / "RPC.XML").write_text(dimap_3(CAMERA, *firsts))
        with pytest.raises(GeoreferencingError, match="counted from 0 or from 1"):
            read_rpc(tmp_path / "RPC.XML")


def dimap_3(rpc: RPC, first_row: int, first_col: int) -> str:
    """Return RPCs as Pléiades Neo has them, with what is read of it."""
    tags = rpc_to_tags(rpc)
    values = "".join(
        f"<{key}_{i}>{word}</{key}_{i}>"
        for key, value in tags.items()
        if key.endswith("COEFF")
        for i, word in enumerate(value.split(), start=1)
    )
    validity = "".join(
        f"<{key}>{value}</{key}>" for key, value in tags.items() if not key.endswith("COEFF")
    )
    domain = f"<FIRST_ROW>{first_row}</FIRST_ROW><FIRST_COL>{first_col}</FIRST_COL>"
    return (
        "<Dimap_Document><Rational_Function_Model><Resource><X/></Resource>"
        f"<GroundtoImage_Values>{values}</GroundtoImage_Values><RFM_Validity>"
        f"<ImagetoGround_Validity_Domain>{domain}</ImagetoGround_Validity_Domain>{validity}"
        "</RFM_Validity></Rational_Function_Model></Dimap_Document>"
    )


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("a.txt", "LINE_OFF: 5 pixels\n", "lack"),
        ("a.txt", "", "lack"),
        ("a.rpb", 'SpecId = "RPC00C";', "RPC00C are not supported"),
        ("a.xml", "<a></a>", "holds no RPCs"),
        ("a.xml", "no XML", "cannot read"),
        ("a.csv", "", "are read from"),
    ],
)
def test_what_holds_no_rpcs_is_said(tmp_path: Path, name: str, text: str, reason: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(GeoreferencingError, match=reason):
        read_rpc(tmp_path / name)


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("LINE_OFF", "", "cannot be understood"),
        ("LINE_SCALE", "0", "scales of 0"),
        ("LINE_NUM_COEFF", "1 2 3", "3 coefficients"),
        ("SAMP_OFF", "many", "many"),
    ],
)
def test_broken_tags_are_said(key: str, value: str, reason: str) -> None:
    with pytest.raises(GeoreferencingError, match=reason):
        rpc_from_tags(rpc_to_tags(CAMERA) | {key: value}, "image.tif")


def test_an_image_without_rpcs_is_said(tmp_path: Path) -> None:
    path = write_image(tmp_path / "image.tif")
    with (
        open_raster(path, allow_sensor_geometry=True) as source,
        pytest.raises(GeoreferencingError, match="has no RPCs"),
    ):
        rpc_of(source)


def test_other_formats_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="written as"):
        write_rpc(tmp_path / "a.xml", CAMERA)
    with pytest.raises(OutputError, match="cannot write"):
        write_rpc(tmp_path / "none" / "a.txt", CAMERA)
