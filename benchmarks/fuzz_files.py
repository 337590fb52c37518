"""Small healthy files of every kind that GroundTie reads, for `fuzz` to damage."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.enums import Resampling

from groundtie.features.classifier import FeatureClassifier
from groundtie.geometry.models import Frame, PolynomialModel, ThinPlateSpline
from groundtie.geometry.tie_point_files import write_tie_points
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.sensor.polynomials import TERMS
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import write_rpc
from groundtie.sensor.rpc_tags import rpc_to_tags

SIDE = 48
_UTM = CRS.from_epsg(32632)
_GRID = Grid(Affine(10, 0, 500_000, 0, -10, 5_000_000), _UTM, SIDE, SIDE)
_CENTRE = (9.0, 45.15)


def write_seeds(folder: Path) -> None:
    """Write all files into a folder."""
    _write_images(folder)
    _write_transforms(folder)
    _write_sensor(folder)
    classifier = FeatureClassifier(
        "mean-variance", "rbf", 0.5, np.zeros(2), np.ones(2), np.full(2, -3.0), np.full(2, 3.0),
        np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([1.0, -1.0]), 0.1, 10.0,
    )  # fmt: skip
    classifier.write(folder / "classifier.json")
    _write_areas(folder)


def _write(path: Path, values: NDArray[Any], **profile: Any) -> None:
    bands = values.reshape(-1, *values.shape[-2:])
    shape = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2]}
    usual = {"driver": "GTiff", "dtype": bands.dtype, "crs": _UTM, "transform": _GRID.transform}
    with rasterio.open(path, "w", **{**usual, **shape, **profile}) as dataset:
        dataset.write(bands)


def _write_images(folder: Path) -> None:
    image = np.random.default_rng(0).integers(1, 255, (3, SIDE, SIDE)).astype(np.uint8)
    _write(folder / "image.tif", image[0], nodata=0)
    _write(folder / "lzw.tif", image, compress="lzw", interleave="pixel", photometric="RGB")
    tiles = {"tiled": True, "blockxsize": 16, "blockysize": 16}
    _write(folder / "tiled.tif", image.astype(np.float32), compress="deflate", predictor=3, **tiles)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True):
        _write(folder / "masked.tif", image[:1])
        with rasterio.open(folder / "masked.tif", "r+") as dataset:
            dataset.write_mask(image[1] > 20)
    # An image with companion files: mask, overviews, metadata.
    _write(folder / "beside.tif", image[0])
    with (
        rasterio.Env(TIFF_USE_OVR=True, GDAL_TIFF_INTERNAL_MASK=False),
        rasterio.open(folder / "beside.tif", "r+") as dataset,
    ):
        dataset.build_overviews([2, 4], Resampling.average)
        dataset.write_mask(image[1] > 20)
    (folder / "beside.tif.aux.xml").write_text(
        f"<PAMDataset><SRS>{_UTM.to_wkt().replace('&', '&amp;')}</SRS>"
        "<GeoTransform>500000, 10, 0, 5000000, 0, -10</GeoTransform>"
        '<Metadata><MDI key="SENSOR">x</MDI></Metadata><PAMRasterBand band="1">'
        "<NoDataValue>0</NoDataValue><Offset>1</Offset><Scale>2</Scale>"
        "<ColorInterp>Gray</ColorInterp></PAMRasterBand></PAMDataset>"
    )
    (folder / "image.vrt").write_text(
        f'<VRTDataset rasterXSize="{SIDE}" rasterYSize="{SIDE}"><SRS>EPSG:32632</SRS>'
        "<GeoTransform>500000, 10, 0, 5000000, 0, -10</GeoTransform>"
        '<VRTRasterBand dataType="Byte" band="1"><NoDataValue>0</NoDataValue><ComplexSource>'
        '<SourceFilename relativeToVRT="1">lzw.tif</SourceFilename><SourceBand>1</SourceBand>'
        f'<SourceProperties RasterXSize="{SIDE}" RasterYSize="{SIDE}" DataType="Byte"/>'
        f'<SrcRect xOff="0" yOff="0" xSize="{SIDE}" ySize="{SIDE}"/>'
        f'<DstRect xOff="0" yOff="0" xSize="{SIDE}" ySize="{SIDE}"/><ScaleRatio>1</ScaleRatio>'
        "</ComplexSource></VRTRasterBand></VRTDataset>"
    )


def _write_transforms(folder: Path) -> None:
    random = np.random.default_rng(1)
    frame = Frame.around(_GRID.pixel_to_map(_GRID.outline()))
    coefficients = 0.01 * random.normal(size=(6, 2))
    models = {
        "affine": PolynomialModel("affine", frame, coefficients[:3]),
        "bent": PolynomialModel("polynomial2", frame, coefficients),
    }
    knots = random.uniform(-1, 1, (12, 2))
    weights = 1e-3 * random.normal(size=(12, 2))
    models_of = {
        **models,
        "spline": ThinPlateSpline("tps", frame, knots, weights, np.zeros((3, 2))),
    }
    for name, model in models_of.items():
        values = Transform(model, _UTM, _GRID).to_json()
        (folder / f"{name}.json").write_text(json.dumps(values))
    transform = Transform(models["affine"], _UTM, _GRID)
    px = random.uniform(2, SIDE - 3, (20, 2))
    points = TiePoints(
        transform.inverse(px), px, np.full(20, 9.0), np.tile(np.eye(2), (20, 1, 1)),
        np.full(20, 0.1), np.arange(20) % 5 == 0, np.full(20, "used"),
    )  # fmt: skip
    for suffix in ("gpkg", "geojson", "csv", "points"):
        write_tie_points(folder / f"points.{suffix}", points, transform)


def _write_sensor(folder: Path) -> None:
    size = SIDE / 2
    scale = (10 * size / 78_400, 10 * size / 111_195, 400.0)
    numerators = np.zeros((2, TERMS))
    # Columns run east, rows south; heights cause relief displacement.
    numerators[0, [1, 3]], numerators[1, [2, 3]] = (1.0, 0.1), (-1.0, 0.05)
    one = (1.0, *[0.0] * (TERMS - 1))
    middle = (size - 0.5, size - 0.5)
    sample, line = (tuple(row.tolist()) for row in numerators)
    rpc = RPC((*_CENTRE, 400.0), scale, middle, (size, size), (sample, one, line, one))
    image = np.random.default_rng(2).integers(1, 255, (SIDE, SIDE)).astype(np.uint8)
    _write(folder / "sensor.tif", image, crs=None, transform=None)
    write_rpc(folder / "rpc.txt", rpc)
    write_rpc(folder / "rpc.rpb", rpc)
    tags = rpc_to_tags(rpc)
    (folder / "rpc.xml").write_text(_dimap(tags))
    with rasterio.open(folder / "sensor.tif", "r+") as dataset:
        dataset.update_tags(ns="RPC", **tags)
    place = {"crs": CRS.from_epsg(4326), "transform": Affine(2e-4, 0, 8.98, 0, -2e-4, 45.17)}
    heights = (300 + 50 * np.sin(np.arange(200 * 200) / 900)).reshape(200, 200)
    _write(folder / "dem.tif", heights.astype(np.float32), nodata=-9999, **place)
    place["transform"] = Affine(0.25, 0, 7.875, 0, -0.25, 46.125)
    _write(folder / "geoid.tif", np.full((9, 9), 45.0, np.float32), **place)


def _dimap(tags: dict[str, str]) -> str:
    model, validity = [], []
    for key, value in tags.items():
        words = value.split()
        if key.endswith("COEFF"):
            model += [f"<{key}_{i}>{w}</{key}_{i}>" for i, w in enumerate(words, start=1)]
        elif not key.startswith("ERR"):
            validity.append(f"<{key}>{value}</{key}>")
    return (
        "<Dimap_Document><Rational_Function_Model><Global_RFM>"
        f"<Inverse_Model>{''.join(model)}</Inverse_Model>"
        f"<RFM_Validity>{''.join(validity)}</RFM_Validity>"
        "</Global_RFM></Rational_Function_Model></Dimap_Document>"
    )


def _write_areas(folder: Path) -> None:
    import fiona

    ring = [(500_050, 4_999_900), (500_300, 4_999_900), (500_200, 4_999_600), (500_050, 4_999_900)]
    schema = {"geometry": "Polygon", "properties": {"class": "int"}}
    for name, driver in (("areas.gpkg", "GPKG"), ("areas.geojson", "GeoJSON")):
        with fiona.open(
            folder / name, "w", driver=driver, crs_wkt=_UTM.to_wkt(), schema=schema
        ) as layer:
            geometry = {"type": "Polygon", "coordinates": [ring]}
            layer.write({"type": "Feature", "geometry": geometry, "properties": {"class": 1}})
