"""What a raster states of its bands, and the types of their pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from rasterio.enums import ColorInterp


@dataclass(frozen=True)
class BandInfo:
    """What a raster states of one of its bands."""

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
        """Return a grey band of which nothing else is stated."""
        return cls(dtype, nodata, ColorInterp.gray, None, None, 1.0, 0.0, {})

    @classmethod
    def of(cls, dataset: Any, index: int) -> BandInfo:
        """Return what a rasterio dataset states of the band with an index, from 0."""
        return cls(
            dtype=dataset.dtypes[index],
            nodata=dataset.nodatavals[index],
            interpretation=dataset.colorinterp[index],
            description=dataset.descriptions[index],
            unit=dataset.units[index],
            scale=dataset.scales[index],
            offset=dataset.offsets[index],
            tags=dataset.tags(index + 1),
        )

    @property
    def numpy_dtype(self) -> np.dtype[Any]:
        """Type that holds the pixels."""
        # GDAL has complex integers; numpy has none.
        names = {"complex_int16": "complex64", "complex_int32": "complex128"}
        return np.dtype(names.get(self.dtype, self.dtype))


def colormap(dataset: Any) -> dict[int, tuple[int, ...]] | None:
    """Return the palette of a rasterio dataset's first band, or None."""
    if dataset.colorinterp[0] is not ColorInterp.palette:
        return None
    return dict(dataset.colormap(1))


def working_dtype(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the floating-point or complex type in which values of `dtype` are computed with."""
    if dtype.kind == "c":
        return dtype
    exact_in_float32 = dtype.itemsize <= 2 or dtype == np.float32
    return np.dtype(np.float32 if exact_in_float32 else np.float64)


def fits(value: float, dtype: np.dtype[Any]) -> bool:
    """Return whether `dtype` can hold `value`."""
    if dtype.kind in "fc":
        return True
    limits = np.iinfo(dtype)
    return bool(value == int(value) and limits.min <= value <= limits.max)
