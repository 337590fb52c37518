"""Rasters in memory: numpy and xarray arrays with their place on the map."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.errors import CRSError

from .errors import GeoreferencingError, ParameterError

# Types that GDAL or OpenCV do not support, and supported types that hold their values.
_HELD_BY = {
    np.dtype(bool): np.dtype(np.uint8),
    np.dtype(np.float16): np.dtype(np.float32),
    np.dtype(np.longdouble): np.dtype(np.float64),
    np.dtype(np.clongdouble): np.dtype(np.complex128),
}


# Transforms that differ by less at the corners are the same.
_SAME_PX = 1e-3

# Coordinates of an even grid may be rounded by this much, as degrees to six digits are; where a row
# or column is missing, one of them is off by half a pixel or more.
_EVEN_PX = 0.05

# Coordinates of all pixels, by which rioxarray locates an array that is rotated on its map.
_ROTATED = ("xc", "yc")

# Arrays of other programs have up to four colours last. A raster of so few columns cannot be
# matched.
_MOST_BANDS_LAST = 4


@dataclass(frozen=True, eq=False, repr=False)
class Raster:
    """An array with its place on the map, which tools take instead of a raster file.

    Parameters
    ----------
    values
        Pixels, shape (h, w) or (bands, h, w). Masked pixels, NaN and infinity hold no data.
    transform
        Corner-based geotransform, as rasterio's and GDAL's; None: positions are pixels.
    crs
        Coordinate reference system, or a value for `rasterio.crs.CRS.from_user_input`
        ("EPSG:32632", 32632); None: local coordinates.
    nodata
        Value of pixels that hold no data.
    called
        Its name in messages, beside its size: tools use the parameter's name.

    Raises
    ------
    ParameterError
        The values are no image of numbers, the transform or CRS is invalid, or nodata is no number.
    GeoreferencingError
        A CRS without a transform.
    """

    values: NDArray[Any]
    transform: Affine | None = None
    crs: CRS | None = None
    nodata: float | None = None
    called: str = ""

    def __post_init__(self) -> None:
        own = np.asanyarray(self.values).dtype.newbyteorder("=")
        object.__setattr__(self, "values", _pixels(self.values))
        object.__setattr__(self, "crs", _crs(self.crs))
        object.__setattr__(self, "nodata", _nodata(self.nodata, own))
        if self.transform is None and self.crs is not None:
            raise GeoreferencingError("an array with a CRS needs its transform, too")
        if self.transform is not None and not isinstance(self.transform, Affine):
            raise ParameterError(
                f"transform must be an affine.Affine, not {type(self.transform).__name__}"
            )
        # The comparison is also false if the transform holds NaN.
        if self.transform is not None and not 0 < abs(self.transform.determinant) < np.inf:
            raise GeoreferencingError("the array's transform gives its pixels no size")

    @classmethod
    def from_xarray(cls, array: Any) -> Raster:
        """Return an `xarray.DataArray` that rioxarray locates (extra `xarray`) as a raster.

        An array with a CRS, but neither coordinates nor a transform, is in pixel coordinates.

        Raises
        ------
        ParameterError
            rioxarray is not imported, or the array has other dimensions than bands, y and x.
        GeoreferencingError
            Its coordinates are uneven: rows or columns are missing.
        """
        if not hasattr(array, "rio"):
            raise ParameterError("a DataArray needs rioxarray: install and import it")
        from rioxarray.exceptions import RioXarrayError

        located = array.rio
        try:
            across, down = located.x_dim, located.y_dim
        except RioXarrayError as error:
            raise ParameterError(
                f"an xarray.DataArray needs dimensions y and x: {error}"
            ) from error
        others = [dim for dim in array.dims if dim not in (across, down)]
        if len(others) > 1:
            raise ParameterError(f"an array has bands, y and x, not {', '.join(map(str, others))}")
        transform = _transform_of(array)
        # As of files: without a transform, a CRS locates nothing.
        crs = None if transform is None or located.crs is None else located.crs.to_wkt()
        values = array.transpose(*others, down, across).values
        return cls(values, transform, crs, located.nodata)

    def to_xarray(self) -> Any:
        """Return this raster as an `xarray.DataArray` (extra `xarray`) of (band, y, x) or (y, x).

        Masked pixels become NaN.

        Raises
        ------
        ImportError
            rioxarray is not installed.
        """
        try:
            import rioxarray  # noqa: F401 (gives arrays their accessor)
            import xarray
        except ImportError as error:
            raise ImportError(
                "a DataArray needs rioxarray: pip install 'groundtie[xarray]'"
            ) from error

        values = self.values
        if isinstance(values, np.ma.MaskedArray):
            held = values.astype(np.result_type(values.dtype, np.float32))
            values = np.where(np.ma.getmaskarray(values), np.nan, held.data)
        dims = ("band", "y", "x")[-values.ndim :]
        place = Affine.identity() if self.transform is None else self.transform
        col, row = np.arange(self.width) + 0.5, np.arange(self.height)[:, None] + 0.5
        x, y = (p * col + q * row + r for p, q, r in (place[:3], place[3:6]))
        coords: dict[str, Any] = {"x": x[0], "y": y[:, 0]}
        if (place.b, place.d) != (0, 0):  # as rioxarray locates rotated arrays
            coords = {name: (("y", "x"), at) for name, at in zip(_ROTATED, (x, y), strict=True)}
        array = xarray.DataArray(values, coords, dims).rio.write_transform(place)
        array = array if self.crs is None else array.rio.write_crs(self.crs)
        return array if self.nodata is None else array.rio.write_nodata(self.nodata)

    @property
    def bands(self) -> NDArray[Any]:
        """The values, shape (bands, h, w)."""
        return self.values if self.values.ndim == 3 else self.values[None]

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.values.shape[-1])

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.values.shape[-2])

    @property
    def name(self) -> str:
        """Its name in messages."""
        size = f"array of {self.width} × {self.height}"
        return f"{size} ({self.called})" if self.called else size

    @property
    def identity(self) -> Hashable:
        """Equal for rasters whose pixels are the same numbers in the same memory."""
        held = np.ma.getdata(self.values)
        return held.__array_interface__["data"][0], held.shape, held.strides, held.dtype.str

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        held = np.asarray(self.values, dtype)
        return held.copy() if copy else held

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        place = "pixel coordinates" if self.transform is None else self.crs or "no CRS"
        return f"<Raster {self.values.shape} {self.values.dtype}, {place}>"


def in_memory(value: Any) -> Any:
    """Return a raster that is given otherwise than by name, as a `Raster` or an open dataset.

    Parameters
    ----------
    value
        A `Raster`, a numpy array (in pixel coordinates), an `xarray.DataArray` with rioxarray's
        accessor, or a dataset that rasterio has open. Anything else gives None.

    Raises
    ------
    ParameterError
        The value is one of these, but cannot be used.
    """
    # A dataset that rasterio has open: a file, a `MemoryFile` or a `WarpedVRT`.
    is_dataset = hasattr(value, "read_masks") and hasattr(value, "nodatavals")
    if isinstance(value, Raster) or is_dataset:
        return value
    if isinstance(value, np.ndarray):
        return Raster(value)
    if hasattr(value, "data_vars"):
        raise ParameterError("a Dataset holds several arrays: give one of them, as dataset[name]")
    if hasattr(value, "dims") and hasattr(value, "coords"):
        return Raster.from_xarray(value)
    return None


def _pixels(values: Any) -> NDArray[Any]:
    array = np.asanyarray(values)
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise ParameterError(
            f"an array must have the shape (h, w) or (bands, h, w), not {array.shape}"
        )
    if array.ndim == 3 and array.shape[2] <= _MOST_BANDS_LAST < array.shape[0]:
        raise ParameterError(
            f"an array has its bands first, and {array.shape} looks as if they were last: give "
            "array.transpose(2, 0, 1)"
        )
    if array.dtype.kind not in "buifc":
        raise ParameterError(f"an array must hold numbers, not {array.dtype}")
    native = array.dtype.newbyteorder("=")
    return array.astype(_HELD_BY.get(native, native), copy=False)


def _transform_of(array: Any) -> Affine | None:
    """Return the transform of a `DataArray`; None if nothing locates it."""
    located = array.rio
    stored = located.transform()
    # The stored transform is exact, but may be that of a larger array of which this is a part:
    # coordinates show which.
    if located.x_dim in array.coords and located.y_dim in array.coords:
        for dim in (located.x_dim, located.y_dim):
            _require_even(str(dim), np.asarray(array.coords[dim]))
        found = located.transform(recalc=True)
    elif all(name in array.coords for name in _ROTATED):
        found = _transform_by(*(np.asarray(array.coords[name]) for name in _ROTATED))
    else:
        # rioxarray returns the identity if there is no transform.
        return None if stored.is_identity else stored
    corners = np.array([[0, 0, 1], [located.width, located.height, 1]])
    apart = corners @ np.subtract(found[:6], stored[:6]).reshape(2, 3).T
    return stored if np.abs(apart).max() < _SAME_PX * np.hypot(found.a, found.d) else found


def _transform_by(x: NDArray[Any], y: NDArray[Any]) -> Affine:
    """Return the transform by the coordinates of all pixels of a rotated array, shape (h, w)."""
    xy = np.stack([x, y])
    height, width = x.shape
    right = (xy[:, 0, -1] - xy[:, 0, 0]) / max(width - 1, 1)
    down = (xy[:, -1, 0] - xy[:, 0, 0]) / max(height - 1, 1)
    cols, rows = np.arange(width), np.arange(height)[:, None]
    even = np.stack(
        [x[0, 0] + right[0] * cols + down[0] * rows, y[0, 0] + right[1] * cols + down[1] * rows]
    )
    if not np.abs(xy - even).max() <= _EVEN_PX * np.hypot(*right):
        raise _uneven(", ".join(_ROTATED))
    corner = xy[:, 0, 0] - (right + down) / 2
    return Affine(*(float(n) for axis in zip(right, down, corner, strict=True) for n in axis))


def _require_even(name: str, coordinates: NDArray[Any]) -> None:
    """Raise an error unless coordinates, shape (n,), are those of an even grid."""
    even, step = np.linspace(coordinates[0], coordinates[-1], coordinates.size, retstep=True)
    # Coordinates of netCDF are often 4-byte floats, rounded by more than a share of a pixel.
    rounded = np.spacing(np.abs(coordinates).max()) if coordinates.dtype.kind == "f" else 0.0
    apart = np.abs(coordinates - even).max()
    # The step is NaN for a single coordinate, and if one of several is NaN.
    if coordinates.size > 1 and not apart <= _EVEN_PX * abs(step) + 2 * rounded:
        raise _uneven(name)


def _uneven(names: str) -> GeoreferencingError:
    return GeoreferencingError(
        f"the coordinates {names} of an array are uneven: rows or columns of it are missing, or in "
        "another order"
    )


def _crs(crs: Any) -> CRS | None:
    try:
        return None if crs is None else CRS.from_user_input(crs)
    except (CRSError, TypeError, ValueError) as error:
        raise ParameterError(f"no coordinate reference system: {crs!r}") from error


def _nodata(nodata: Any, own: np.dtype[Any]) -> Any:
    if nodata is not None and not isinstance(nodata, Real):
        raise ParameterError(f"nodata must be a number, not {nodata!r}")
    if nodata is not None and own == np.float16:
        # Rounded as in the array: tolerances for single precision are narrower.
        with np.errstate(over="ignore"):
            return float(np.float16(nodata))
    # Not as a float, which would round large whole numbers.
    return nodata
