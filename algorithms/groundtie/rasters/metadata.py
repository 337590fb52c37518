"""Metadata of a raster: its grid, its bands, and the types of their pixels."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, MaskFlags

from ..errors import GeoreferencingError, raised_by
from .grid import PIXEL_COORDINATES, Grid, is_invertible, require_map

T = TypeVar("T")

# Ten years of daily images are 3653 bands. Each band costs calls of GDAL, and a file of 14 kB can
# declare 65,535 bands.
MOST_BANDS = 4096

# Also within a name, as in "sigma0_db".
_DECIBEL = re.compile(r"(?<![a-z])(db|decibels?)(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class BandInfo:
    """Metadata of a band."""

    dtype: str
    nodata: float | None
    interpretation: ColorInterp
    description: str | None
    unit: str | None
    scale: float
    offset: float
    tags: dict[str, str]

    @classmethod
    def plain(cls, dtype: str, nodata: float | None = None) -> BandInfo:
        """Return a grey band without further metadata."""
        return cls(dtype, nodata, ColorInterp.gray, None, None, 1.0, 0.0, {})

    @property
    def is_in_decibels(self) -> bool:
        """Whether its unit or its name, as "Sigma0_VV_db", states decibels."""
        return any(text and _DECIBEL.search(text) for text in (self.unit, self.description))

    @classmethod
    def all_of(cls, dataset: Any) -> tuple[BandInfo, ...]:
        """Return the metadata of each band of a rasterio dataset."""
        # Each of these properties queries all bands, so that a query by band would be quadratic.
        columns = (
            stated(lambda: dataset.dtypes),
            stated(lambda: dataset.nodatavals),
            stated(lambda: dataset.colorinterp),
            stated(lambda: dataset.descriptions),
            stated(lambda: dataset.units),
            stated(lambda: dataset.scales),
            stated(lambda: dataset.offsets),
            [tags_of(dataset, bidx=number) for number in range(1, dataset.count + 1)],
        )
        return tuple(cls(*band) for band in zip(*columns, strict=True))


def numpy_dtype(name: str) -> np.dtype[Any]:
    """Return the type that holds the pixels of a band, from rasterio's name of its type."""
    # GDAL has complex integers; numpy has none.
    return np.dtype({"complex_int16": "complex64", "complex_int32": "complex128"}.get(name, name))


def stated(read: Callable[[], T]) -> T:
    """Return a property of a rasterio dataset in spite of earlier warnings of GDAL.

    For some properties, rasterio takes any earlier message of GDAL, such as on an odd tag, for a
    failure, and clears the message. The second attempt then succeeds.
    """
    try:
        return read()
    except Exception as error:
        if not raised_by(error, "rasterio"):
            raise
        return read()


def has_own_mask(flags: Collection[MaskFlags], nodata: float | None) -> bool:
    """Return whether only a mask of its own marks the valid pixels of a band.

    rasterio drops nodata values that double precision rounds out of the range of 64 bits.
    """
    return not flags or (set(flags) == {MaskFlags.nodata} and nodata is None)


def tags_of(dataset: Any, **which: Any) -> dict[str, str]:
    """Return the tags of a domain (`ns`) or band (`bidx`) of a rasterio dataset.

    Empty if they are not UTF-8 and thus unreadable.
    """
    try:
        return dict(stated(lambda: dataset.tags(**which)))
    except UnicodeDecodeError:
        return {}


def colormap(dataset: Any) -> dict[int, tuple[int, ...]] | None:
    """Return the palette of a rasterio dataset's first band, or None."""
    if stated(lambda: dataset.colorinterp[0]) is not ColorInterp.palette:
        return None
    return dict(stated(lambda: dataset.colormap(1)))


def working_dtype(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the floating-point or complex type for computations with values of `dtype`."""
    if dtype.kind == "c":
        return dtype
    exact_in_float32 = dtype.itemsize <= 2 or dtype == np.float32
    return np.dtype(np.float32 if exact_in_float32 else np.float64)


def rounded(values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return floating-point values in another type; the argument may be overwritten."""
    if dtype.kind in "fc" or values.dtype == dtype:
        return values.astype(dtype, copy=False)
    limits = np.iinfo(dtype)
    np.rint(values, out=values)
    highest = values.dtype.type(limits.max)
    if int(highest) > limits.max:  # rounded up beyond the range of the other type
        highest = np.nextafter(highest, values.dtype.type(0))
    return np.clip(values, limits.min, highest, out=values).astype(dtype)


def fits(value: float, dtype: np.dtype[Any]) -> bool:
    """Return whether `dtype` can hold `value`."""
    if dtype.kind in "fc":
        return True
    if not math.isfinite(value):
        return False
    limits = np.iinfo(dtype)
    return bool(value == int(value) and limits.min <= value <= limits.max)


def grid_of(name: str, dataset: Any, *, allow_sensor_geometry: bool) -> Grid:
    """Return the grid of a rasterio dataset; in pixel coordinates if it has no geotransform.

    Parameters
    ----------
    name
        Name in messages.
    dataset
        The dataset, open.
    allow_sensor_geometry
        Accept images located by RPCs or GCPs only, in pixel coordinates.

    Raises
    ------
    GeoreferencingError
        The image is located by RPCs or GCPs only, its pixels have no size, or its CRS is not that
        of a map.
    """
    crs, transform = stated(lambda: dataset.crs), dataset.transform
    if transform.is_identity:
        # rasterio's value for a missing geotransform, without which a CRS locates nothing.
        if not allow_sensor_geometry:
            _refuse_sensor_geometry(name, dataset)
        crs, transform = None, PIXEL_COORDINATES
    if not is_invertible(transform):
        raise GeoreferencingError(f"{name} has a geotransform that gives its pixels no size")
    try:
        return Grid(transform, require_map(crs), dataset.width, dataset.height)
    except GeoreferencingError as error:
        raise GeoreferencingError(f"{name}: {error}") from error


def _refuse_sensor_geometry(name: str, dataset: Any) -> None:
    located_by = ""
    if stated(lambda: dataset.tags(ns="RPC")):
        located_by, remedy = "RPCs", "orthorectify it first (tool orthorectify)"
    elif stated(lambda: dataset.gcps)[0]:
        located_by, remedy = "ground control points", "warp it by them first (gdalwarp -tps)"
    if located_by:
        raise GeoreferencingError(f"{name} is located by {located_by} only; {remedy}")
