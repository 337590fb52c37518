"""Reading windows of rasters, with all their ways of saying that a pixel holds no data."""

from __future__ import annotations

import contextlib
import os
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
import rasterio
import rasterio.windows
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, MaskFlags
from rasterio.env import env_ctx_if_needed
from rasterio.errors import NotGeoreferencedWarning, RasterioError, RasterioIOError

from ..errors import BandError, GeoreferencingError, RasterOpenError
from .averaging import area_average
from .grid import PIXEL_COORDINATES, Grid

# Images without georeferencing are a supported case; `Grid.is_georeferenced` tells them.
warnings.filterwarnings("ignore", category=NotGeoreferencedWarning)

# Pixels that a reduced read holds at a time.
_STRIP_PIXELS = 4_000_000

# GDAL keeps what it has read up to a twentieth of the machine's memory, unless it is told less.
# Chips are read again and again; what is written is not.
_READING_CACHE_BYTES = 400_000_000
CACHE_BYTES = 96_000_000

FloatImage = NDArray[np.float32]
Mask = NDArray[np.bool_]


class Window(NamedTuple):
    """A rectangle of pixels; it may reach beyond the raster."""

    col: int
    row: int
    width: int
    height: int


@dataclass(frozen=True)
class BandInfo:
    """What a raster says of one of its bands."""

    dtype: str
    nodata: float | None
    interpretation: ColorInterp
    description: str | None
    unit: str | None
    scale: float
    offset: float
    tags: dict[str, str]


@dataclass(frozen=True)
class RasterSource:
    """A raster that is open for reading, from any number of threads at a time.

    Parameters
    ----------
    path
        Name of the file, or GDAL's name of the dataset.
    grid
        Where its pixels lie; pixel coordinates if the file does not say.
    bands
        What the file says of each band.
    has_mask_band
        Whether a mask that is no band (`.msk`, internal mask) tells the valid pixels.
    interleave
        "pixel", "band" or None.
    colormap
        Palette of the first band, or None.
    tags
        Metadata of the dataset by GDAL's domains ("" is the default one).
    """

    path: str
    grid: Grid
    bands: tuple[BandInfo, ...]
    has_mask_band: bool
    interleave: str | None
    colormap: dict[int, tuple[int, ...]] | None
    tags: dict[str, dict[str, str]]
    _handles: _Handles = field(repr=False, compare=False)

    def __enter__(self) -> RasterSource:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; reading opens it again."""
        self._handles.close()

    @property
    def count(self) -> int:
        """Number of bands."""
        return len(self.bands)

    @property
    def window(self) -> Window:
        """The whole raster."""
        return Window(0, 0, self.grid.width, self.grid.height)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type that holds the pixels of every band."""
        return np.result_type(*(_numpy_dtype(band.dtype) for band in self.bands))

    @property
    def is_complex(self) -> bool:
        """Whether the pixels are complex numbers."""
        return self.dtype.kind == "c"

    @property
    def alpha_band(self) -> int | None:
        """Number, from 1, of the band that tells opacity."""
        kinds = [band.interpretation for band in self.bands]
        return kinds.index(ColorInterp.alpha) + 1 if ColorInterp.alpha in kinds else None

    @property
    def says_what_is_valid(self) -> bool:
        """Whether nodata values, a mask or an alpha band tell which pixels are valid."""
        declared = any(band.nodata is not None for band in self.bands)
        return declared or self.has_mask_band or self.alpha_band is not None

    @property
    def image_bands(self) -> tuple[int, ...]:
        """Numbers, from 1, of the bands that are not alpha."""
        return tuple(i for i in range(1, self.count + 1) if i != self.alpha_band)

    def read(
        self, window: Window, band: int | None = None, out_shape: tuple[int, int] | None = None
    ) -> tuple[FloatImage, Mask]:
        """Read a window as one grey image.

        Parameters
        ----------
        window
            Rectangle of full-resolution pixels; beyond the raster nothing is valid.
        band
            Number of the band, from 1; None takes the mean of all bands but alpha. Scale and
            offset of the bands are not applied.
        out_shape
            Height and width, smaller than the window's, of the result; each of its pixels is
            the mean of the valid pixels in its area. None keeps the full resolution.

        Returns
        -------
        values
            Shape `out_shape`, amplitudes for complex rasters; 0 where invalid.
        valid
            Same shape; False for nodata, masked and transparent pixels, NaN and infinity. A pixel
            of a reduced result is valid if half of its area is; one of several bands if it is
            valid in all.

        Raises
        ------
        BandError
            There is no such band.
        RasterOpenError
            The pixels cannot be read.
        """
        bands = self.image_bands if band is None else (band,)

        def grey(part: Window) -> tuple[NDArray[Any], Mask]:
            values, valid = self.read_bands(part, bands)
            if self.is_complex:
                values = np.abs(values)
            if len(bands) == 1:
                return values.astype(np.float32), valid
            everywhere: Mask = np.asarray(valid.all(axis=0, keepdims=True))
            return values.mean(axis=0, keepdims=True, dtype=np.float32), everywhere

        values, valid = _reduced(grey, window, out_shape)
        grey_values = np.where(valid[0], values[0], np.float32(0)).astype(np.float32)
        return grey_values, valid[0]

    def read_bands(
        self,
        window: Window,
        bands: Sequence[int] | None = None,
        out_shape: tuple[int, int] | None = None,
    ) -> tuple[NDArray[Any], Mask]:
        """Read a window of several bands, each with its own validity.

        Like `read`, but values keep the raster's dtype (a reduced result is floating-point or
        complex) and invalid pixels their values, except that NaN and infinity become 0. Both
        results have the shape (bands, height, width). The alpha band is valid where it is not 0.
        """
        bands = range(1, self.count + 1) if bands is None else bands
        for number in bands:
            if not 1 <= number <= self.count:
                raise BandError(f"{self.path} has no band {number}; it has {self.count}")

        def native(part: Window) -> tuple[NDArray[Any], Mask]:
            with self._handles.borrow() as dataset:
                return self._read_native(dataset, part, bands)

        if out_shape is None:
            return native(window)

        def floating(part: Window) -> tuple[NDArray[Any], Mask]:
            values, valid = native(part)
            return values.astype(working_dtype(values.dtype), copy=False), valid

        return _reduced(floating, window, out_shape)

    def read_untouched(self, window: Window) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Read all bands, shape (bands, h, w), and the mask, (h, w), of a window inside as stored.

        The mask is all 255 if the raster has no mask band.
        """
        place = rasterio.windows.Window(*window)
        with self._handles.borrow() as dataset:
            mask = np.full((window.height, window.width), 255, np.uint8)
            if self.has_mask_band:
                mask = dataset.read_masks(1, window=place)
            return dataset.read(window=place), mask

    def _read_native(
        self, dataset: Any, window: Window, bands: Sequence[int]
    ) -> tuple[NDArray[Any], Mask]:
        shape = (len(bands), window.height, window.width)
        left, top = max(window.col, 0), max(window.row, 0)
        right = min(window.col + window.width, self.grid.width)
        bottom = min(window.row + window.height, self.grid.height)
        inside = Window(left, top, right - left, bottom - top)
        if inside.width <= 0 or inside.height <= 0:
            return np.zeros(shape, self.dtype), np.zeros(shape, bool)
        values = dataset.read(
            list(bands), window=rasterio.windows.Window(*inside), out_dtype=self.dtype
        )
        valid = self._validity(dataset, inside, bands, values)
        if inside == window:
            return values, valid
        padded, padded_valid = np.zeros(shape, self.dtype), np.zeros(shape, bool)
        rows = slice(top - window.row, bottom - window.row)
        cols = slice(left - window.col, right - window.col)
        padded[:, rows, cols], padded_valid[:, rows, cols] = values, valid
        return padded, padded_valid

    def _validity(
        self, dataset: Any, inside: Window, bands: Sequence[int], values: NDArray[Any]
    ) -> Mask:
        """Tell the valid pixels of `values`, and set those that are not finite to 0."""
        valid = np.ones(values.shape, bool)
        if values.dtype.kind in "fc":
            valid = np.isfinite(values)
            values[~valid] = 0
        place = rasterio.windows.Window(*inside)
        for i, number in enumerate(bands):
            if number == self.alpha_band:
                valid[i] = values[i] > 0
                continue
            nodata = self.bands[number - 1].nodata
            if nodata is not None and fits(nodata, values.dtype):
                valid[i] &= values[i] != values.dtype.type(nodata)
            if self.has_mask_band:
                valid[i] &= dataset.read_masks(number, window=place) > 0
            if self.alpha_band is not None:
                valid[i] &= dataset.read(self.alpha_band, window=place) > 0
        return valid


def open_raster(
    path: str | os.PathLike[str], *, allow_sensor_geometry: bool = False
) -> RasterSource:
    """Open a raster for reading.

    Parameters
    ----------
    path
        A file, or any name that GDAL understands (`/vsizip/…`, `NETCDF:…`).
    allow_sensor_geometry
        Take images that are located by RPCs or GCPs only; their grid is in pixel coordinates.

    Raises
    ------
    RasterOpenError
        There is no such file, or it cannot be read.
    GeoreferencingError
        The image is located by RPCs or GCPs only.
    """
    name = os.fspath(path)
    handles = _Handles(name)
    with handles.borrow() as dataset:
        if dataset.count == 0:
            inner = ", ".join(dataset.subdatasets[:3]) or "none"
            raise RasterOpenError(f"{name} holds no bands itself; open a raster inside it: {inner}")
        transform = dataset.transform
        if dataset.crs is None and transform.is_identity:
            if not allow_sensor_geometry:
                _refuse_sensor_geometry(name, dataset)
            transform = PIXEL_COORDINATES
        flags = dataset.mask_flag_enums[0]
        return RasterSource(
            path=name,
            grid=Grid(transform, dataset.crs, dataset.width, dataset.height),
            bands=tuple(_band_info(dataset, i) for i in range(dataset.count)),
            has_mask_band=MaskFlags.per_dataset in flags and MaskFlags.alpha not in flags,
            interleave=dataset.interleaving.value.lower() if dataset.interleaving else None,
            colormap=_colormap(dataset),
            tags={ns: dataset.tags(ns=ns or None) for ns in ("", *dataset.tag_namespaces())},
            _handles=handles,
        )


def bounded_cache() -> Any:
    """Return the environment in which GDAL keeps a bounded amount of what it has read."""
    return rasterio.Env(GDAL_CACHEMAX=_READING_CACHE_BYTES)


def working_dtype(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the floating-point or complex type in which values of `dtype` are computed with."""
    if dtype.kind == "c":
        return dtype
    exact_in_float32 = dtype.itemsize <= 2 or dtype == np.float32
    return np.dtype(np.float32 if exact_in_float32 else np.float64)


def fits(value: float, dtype: np.dtype[Any]) -> bool:
    """Tell whether `dtype` can hold `value`."""
    if dtype.kind in "fc":
        return True
    limits = np.iinfo(dtype)
    return bool(value == int(value) and limits.min <= value <= limits.max)


class _Handles:
    """GDAL's handles of one file: each is used by one thread at a time, as GDAL demands."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._free: list[Any] = []

    @contextlib.contextmanager
    def borrow(self) -> Iterator[Any]:
        """Lend a handle; what goes wrong while reading with it becomes `RasterOpenError`."""
        try:
            with self._lock:
                dataset = self._free.pop() if self._free else None
            dataset = dataset or rasterio.open(self._path, sharing=False)
            with env_ctx_if_needed():  # GDAL's messages in this thread go to rasterio's logger
                yield dataset
        # RasterioIOError is no RasterioError before rasterio 1.4.
        except (RasterioError, RasterioIOError) as error:
            reason = error.__cause__ or error
            raise RasterOpenError(f"cannot read {self._path}: {reason}") from error
        with self._lock:
            self._free.append(dataset)

    def close(self) -> None:
        with self._lock:
            while self._free:
                self._free.pop().close()


def _reduced(
    read: Callable[[Window], tuple[NDArray[Any], Mask]],
    window: Window,
    out_shape: tuple[int, int] | None,
) -> tuple[NDArray[Any], Mask]:
    """Average what `read` returns for `window` to `out_shape`, strip by strip."""
    if out_shape is None:
        return read(window)
    row_edges = np.linspace(0, window.height, out_shape[0] + 1)
    col_edges = np.linspace(0, window.width, out_shape[1] + 1)
    lines = max(int(_STRIP_PIXELS / window.width * out_shape[0] / window.height), 1)
    strips = []
    for first in range(0, out_shape[0], lines):
        edges = row_edges[first : first + lines + 1]
        top, bottom = int(np.floor(edges[0])), int(np.ceil(edges[-1]))
        part = Window(window.col, window.row + top, window.width, bottom - top)
        values, valid = read(part)
        pairs = zip(values, valid, strict=True)
        strips.append([area_average(v, ok, edges - top, col_edges) for v, ok in pairs])
    bands = [zip(*band, strict=True) for band in zip(*strips, strict=True)]
    images = [(np.concatenate(v), np.concatenate(ok)) for v, ok in bands]
    return np.stack([v for v, _ in images]), np.stack([ok for _, ok in images])


def _band_info(dataset: Any, index: int) -> BandInfo:
    return BandInfo(
        dtype=dataset.dtypes[index],
        nodata=dataset.nodatavals[index],
        interpretation=dataset.colorinterp[index],
        description=dataset.descriptions[index],
        unit=dataset.units[index],
        scale=dataset.scales[index],
        offset=dataset.offsets[index],
        tags=dataset.tags(index + 1),
    )


def _colormap(dataset: Any) -> dict[int, tuple[int, ...]] | None:
    if dataset.colorinterp[0] is not ColorInterp.palette:
        return None
    return dict(dataset.colormap(1))


def _numpy_dtype(name: str) -> np.dtype[Any]:
    # GDAL knows complex integers; numpy does not.
    return np.dtype({"complex_int16": "complex64", "complex_int32": "complex128"}.get(name, name))


def _refuse_sensor_geometry(name: str, dataset: Any) -> None:
    located_by = "RPCs" if dataset.rpcs else "ground control points" if dataset.gcps[0] else ""
    if located_by:
        raise GeoreferencingError(
            f"{name} is located by {located_by} only; orthorectify it first (gdalwarp -rpc or -tps)"
        )
