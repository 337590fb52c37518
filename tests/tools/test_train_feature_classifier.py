from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import fiona
import numpy as np
import pytest
from numpy.typing import NDArray
from raster_files import utm_grid, write_raster
from textured_pairs import listing, texture

from groundtie import train_feature_classifier
from groundtie.errors import (
    GeoreferencingError,
    ParameterError,
    TooFewPointsError,
    VectorLayerError,
)
from groundtie.features.classifier import read_classifier
from groundtie.features.labels import KEPT, LEFT_OUT, UNKNOWN, patch_labels
from groundtie.features.patch_statistics import STATISTICS
from groundtie.rasters.patch import Patch

SIDE = 400
GRID = utm_grid(SIDE, SIDE)

# Clouds lie right of this column.
BORDER = 200


def cloudy_values(seed: int = 0) -> NDArray[np.uint16]:
    image = 1000 + 150 * texture(SIDE, SIDE, seed)
    image[:, BORDER:] = 3000 + 250 * texture(SIDE, SIDE - BORDER, seed + 1)
    return image.astype(np.uint16)


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_raster(tmp_path_factory.mktemp("cloudy") / "image.tif", cloudy_values(), GRID)


def cloud_mask(path: Path, cloud: int = 1) -> Path:
    mask = np.zeros((SIDE, SIDE), np.uint8)
    mask[:, BORDER:] = cloud
    return write_raster(path, mask, GRID)


def layer(path: Path, items: list[tuple[dict[str, Any], Any]], crs: str = "EPSG:32632") -> Path:
    kind = items[0][0]["type"]
    schema = {"geometry": kind, "properties": {"class": "str"}}
    with fiona.open(path, "w", driver="GPKG", schema=schema, crs=crs) as target:
        for geometry, value in items:
            target.write({"geometry": geometry, "properties": {"class": value}})
    return path


def box(left: int, right: int) -> dict[str, Any]:
    """Return a polygon between two columns."""
    px = np.array([[left, 0], [right, 0], [right, SIDE], [left, SIDE], [left, 0]], float)
    return {"type": "Polygon", "coordinates": [GRID.pixel_to_map(px).tolist()]}


def told(path: Path, seed: int = 20) -> tuple[float, float]:
    """Return the shares of clear and of cloudy places of another image that are told rightly."""
    values = cloudy_values(seed).astype(np.float32)
    px = np.random.default_rng(0).uniform(25, SIDE - 25, (500, 2))
    px = px[np.abs(px[:, 0] - BORDER) > 25]
    window = Patch(values, np.ones(values.shape, bool))
    kept = read_classifier(path).keep(window, px, values[None])
    clear = px[:, 0] < BORDER
    return float(kept[clear].mean()), float((~kept[~clear]).mean())


@pytest.mark.slow
@pytest.mark.parametrize("statistics", STATISTICS)
def test_clouds_of_a_mask_are_learned(image: Path, tmp_path: Path, statistics: str) -> None:
    found = train_feature_classifier(
        image,
        tmp_path / "c.json",
        label_raster=cloud_mask(tmp_path / "mask.tif"),
        statistics=statistics,
    )
    assert min(told(tmp_path / "c.json")) > 0.98
    assert found.kept > 50
    assert found.left_out > 50
    # Patches at the border show both.
    assert found.accuracy is not None
    assert found.accuracy > 0.9
    assert json.loads((tmp_path / "c.json").read_text())["pixel_size_m"] == 10.0


@pytest.mark.slow
def test_bands_tell_clouds_from_ground_that_is_as_bright(tmp_path: Path) -> None:
    values = np.repeat(texture(SIDE, SIDE)[None], 3, axis=0) * 100 + 1000
    values[0, :, :BORDER] += 300
    values[2, :, :BORDER] -= 300
    image = write_raster(tmp_path / "image.tif", values.astype(np.uint16), GRID)
    mask = cloud_mask(tmp_path / "mask.tif")
    told = [
        train_feature_classifier(
            image, tmp_path / f"{name}.json", label_raster=mask, statistics=name
        ).accuracy
        for name in ("mean-variance", "band-ratios")
    ]
    assert told[0] is not None
    assert told[1] is not None
    assert told[0] < 0.7
    assert told[1] > 0.9
    assert read_classifier(tmp_path / "band-ratios.json").bands == 3


def test_other_values_may_be_left_out(image: Path, tmp_path: Path) -> None:
    mask = cloud_mask(tmp_path / "mask.tif", cloud=9)
    train_feature_classifier(image, tmp_path / "c.json", label_raster=mask, left_out="8, 9,10")
    assert min(told(tmp_path / "c.json")) > 0.98


@pytest.mark.slow
def test_polygons_of_another_crs_label_the_features_in_them(image: Path, tmp_path: Path) -> None:
    from rasterio.warp import transform_geom

    items = [(box(0, 150), "ground"), (box(250, SIDE), "cloud")]
    wgs84 = [(transform_geom("EPSG:32632", "EPSG:4326", g, precision=9), v) for g, v in items]
    labels = layer(tmp_path / "l.gpkg", wgs84, "EPSG:4326")
    found = train_feature_classifier(image, tmp_path / "c.json", labels=labels, left_out="cloud")
    assert min(told(tmp_path / "c.json")) > 0.98
    # Features between both polygons have no label, so no patch shows both.
    assert found.accuracy == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
def test_points_of_a_layer_are_taken_as_they_are(image: Path, tmp_path: Path) -> None:
    px = np.random.default_rng(1).uniform(25, SIDE - 25, (60, 2))
    px = px[np.abs(px[:, 0] - BORDER) > 25]
    points = [
        ({"type": "Point", "coordinates": tuple(xy)}, "1" if col > BORDER else "0")
        for xy, col in zip(GRID.pixel_to_map(px).tolist(), px[:, 0], strict=True)
    ]
    labels = layer(tmp_path / "l.gpkg", points)
    found = train_feature_classifier(image, tmp_path / "c.json", labels=labels)
    assert found.kept + found.left_out == len(px)
    assert min(told(tmp_path / "c.json")) > 0.95


def test_a_feature_is_labelled_by_what_its_patch_shows() -> None:
    labels = np.full((100, 200), KEPT, np.int8)
    labels[:, 100:] = LEFT_OUT
    labels[60:, :] = UNKNOWN
    # 41 columns around 89 have 10 in the cloud, around 90 there are 11: a quarter is 10.25.
    px = np.array([[89.0, 30.0], [90.0, 30.0], [150.0, 30.0], [30.0, 30.0], [30.0, 70.0]])
    told = patch_labels(labels, px)
    np.testing.assert_array_equal(told, [KEPT, LEFT_OUT, LEFT_OUT, KEPT, UNKNOWN])
    # What is not known, as beyond the image, takes no part.
    px = np.array([[89.0, 59.0], [90.0, 59.0], [195.0, 3.0], [5.0, 3.0]])
    np.testing.assert_array_equal(patch_labels(labels, px), [KEPT, LEFT_OUT, LEFT_OUT, KEPT])


def test_one_kind_of_labels_is_needed(image: Path, tmp_path: Path) -> None:
    mask = cloud_mask(tmp_path / "mask.tif")
    with pytest.raises(ParameterError, match="one of them"):
        train_feature_classifier(image, tmp_path / "c.json")
    with pytest.raises(ParameterError, match="must be numbers"):
        train_feature_classifier(image, tmp_path / "c.json", label_raster=mask, left_out="cloud")
    with pytest.raises(ParameterError, match="names no value"):
        train_feature_classifier(image, tmp_path / "c.json", label_raster=mask, left_out=" ,")
    assert list(listing(tmp_path)) == ["mask.tif"]


def test_labels_of_one_class_are_refused(image: Path, tmp_path: Path) -> None:
    mask = write_raster(tmp_path / "mask.tif", np.zeros((SIDE, SIDE), np.uint8), GRID)
    with pytest.raises(TooFewPointsError, match="only 0 labelled points are to be left out"):
        train_feature_classifier(image, tmp_path / "c.json", label_raster=mask)
    assert list(listing(tmp_path)) == ["mask.tif"]


@pytest.mark.slow
def test_a_layer_that_says_nothing_is_refused(image: Path, tmp_path: Path) -> None:
    labels = layer(tmp_path / "l.gpkg", [(box(0, 150), "ground")])
    with pytest.raises(VectorLayerError, match="no attribute 'kind'; it has: class"):
        train_feature_classifier(image, tmp_path / "c.json", labels=labels, field="kind")
    (tmp_path / "n.gpkg").write_text("nothing")
    with pytest.raises(VectorLayerError, match="cannot read"):
        train_feature_classifier(image, tmp_path / "c.json", labels=tmp_path / "n.gpkg")
    plain = write_raster(tmp_path / "plain.tif", cloudy_values())
    with pytest.raises(GeoreferencingError, match="has a CRS"):
        train_feature_classifier(plain, tmp_path / "c.json", labels=labels)
    assert not (tmp_path / "c.json").exists()
