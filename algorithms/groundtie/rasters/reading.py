"""Reading of windows of rasters, with all ways in which rasters mark pixels without data."""

from __future__ import annotations

import os
import warnings
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rasterio.windows
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, MaskFlags
from rasterio.errors import NotGeoreferencedWarning

from ..arrays import Raster, in_memory
from ..errors import BandError, RasterOpenError
from ..raster_names import is_remote, raster_name
from .averaging import average_window
from .grid import PIXEL_COORDINATES, Grid, require_map
from .handles import ArrayHandles, FileHandles, Handles, OpenDataset
from .metadata import (
    MOST_BANDS,
    BandInfo,
    colormap,
    grid_of,
    has_own_mask,
    numpy_dtype,
    stated,
    tags_of,
)
from .nodata import are_measured
from .remote_overviews import RemoteOverviews
from .windows import FloatImage, Mask, Window, read_values, read_window

# Images without georeferencing are a supported case, see `Grid.is_georeferenced`.
warnings.filterwarnings("ignore", category=NotGeoreferencedWarning)


@dataclass(frozen=True)
class RasterSource:
    """A raster that is open for reading, from any number of threads at a time.

    Parameters
    ----------
    path
        Name of the file, of GDAL's dataset, or of an array.
    grid
        Grid of the pixels; in pixel coordinates if the raster has no georeferencing.
    bands
        Metadata of each band.
    has_mask_band
        Whether a mask outside the bands (`.msk`, internal mask, masked array) marks valid pixels.
    has_masks_by_band
        Whether such masks may differ between bands.
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
    has_masks_by_band: bool
    interleave: str | None
    colormap: dict[int, tuple[int, ...]] | None
    tags: dict[str, dict[str, str]]
    _handles: Handles = field(repr=False, compare=False)
    _overviews: RemoteOverviews | None = field(repr=False, compare=False, default=None)

    def __enter__(self) -> RasterSource:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; reading opens it again. A dataset that the caller opened stays open."""
        self._handles.close()
        if self._overviews is not None:
            self._overviews.close()

    def is_same_as(self, other: RasterSource) -> bool:
        """Return whether both read one and the same raster."""
        return self.identity == other.identity

    @property
    def identity(self) -> Hashable:
        """Key that is equal for sources of the same raster, in any working folder."""
        return self._handles.identity

    @property
    def place(self) -> str | None:
        """Name that opens its file again in any working folder.

        None: it is in memory, or the caller's dataset.
        """
        return self._handles.place if isinstance(self._handles, FileHandles) else None

    @property
    def count(self) -> int:
        """Number of bands."""
        return len(self.bands)

    @property
    def window(self) -> Window:
        """The whole raster."""
        return Window(0, 0, *self.grid.size)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type that holds the pixels of every band."""
        return np.result_type(*(numpy_dtype(band.dtype) for band in self.bands))

    @property
    def is_complex(self) -> bool:
        """Whether the pixels are complex numbers."""
        return self.dtype.kind == "c"

    @property
    def alpha_band(self) -> int | None:
        """Number, from 1, of the band of opacity."""
        kinds = [band.interpretation for band in self.bands]
        # A single band is the image, whatever its interpretation.
        is_there = ColorInterp.alpha in kinds and len(kinds) > 1
        return kinds.index(ColorInterp.alpha) + 1 if is_there else None

    @property
    def says_what_is_valid(self) -> bool:
        """Whether nodata values, a mask or an alpha band mark which pixels are valid."""
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
            Height and width of the result, smaller than the window's. Each of its pixels is the
            mean of the valid pixels in its area. None keeps the full resolution. Remote rasters
            are read from overviews, as far as these hold such means.

        Returns
        -------
        values
            Shape `out_shape`, amplitudes for complex rasters; 0 where invalid.
        valid
            Same shape; False for nodata, masked and transparent pixels, NaN, infinity, the lowest
            number of single precision and numbers beyond its range. A pixel of a reduced result is
            valid if half of its area is; a pixel of several bands, if it is valid in all of them.

        Raises
        ------
        BandError
            There is no such band.
        RasterOpenError
            The pixels cannot be read.
        """
        bands = self.image_bands if band is None else (band,)

        def grey(source: RasterSource, part: Window) -> tuple[NDArray[Any], Mask]:
            values, valid = source.read_bands(part, bands)
            with np.errstate(over="ignore", invalid="ignore"):
                if self.is_complex:
                    values = np.abs(values)
                one = len(bands) == 1
                image = (
                    values[0].astype(np.float32, copy=False) if one else values.mean(0, np.float32)
                )
            known = np.asarray(valid.all(axis=0))
            # Integers are finite; a single band of single precision was checked when it was read.
            if self.dtype.kind in "fc" and not (one and self.dtype == np.float32):
                known &= are_measured(image)
            return image, known

        if out_shape is None:
            values, valid = grey(self, window)
        else:
            level = self
            if self._overviews is not None:
                reduction = min(window.height / out_shape[0], window.width / out_shape[1])
                level = self._overviews.coarsest(self, reduction)
            values, valid = average_window(grey, self, level, window, out_shape)
            # Sums of finite numbers may overflow.
            valid &= np.isfinite(values)
        return np.where(valid, values, np.float32(0)).astype(np.float32, copy=False), valid

    def read_bands(
        self,
        window: Window,
        bands: Sequence[int] | None = None,
        out_shape: tuple[int, int] | None = None,
    ) -> tuple[NDArray[Any], Mask]:
        """Read a window of several bands, each with its own validity.

        As `read`, but the values keep the raster's dtype (a reduced result is floating-point or
        complex). Invalid pixels keep their values, except that NaN, infinity and the lowest number
        become 0. Both results have the shape (bands, height, width). The alpha band is valid where
        it is not 0.
        """
        bands = range(1, self.count + 1) if bands is None else bands
        for number in bands:
            if not 1 <= number <= self.count:
                raise BandError(f"{self.path} has no band {number}; it has {self.count}")

        def native(source: RasterSource, part: Window) -> tuple[NDArray[Any], Mask]:
            with source._handles.borrow() as dataset:
                return read_window(dataset, source, part, bands)

        if out_shape is None:
            return native(self, window)
        return average_window(native, self, self, window, out_shape)

    def driver(self) -> str:
        """Return the name of the GDAL driver that reads the raster."""
        with self._handles.borrow() as dataset:
            return str(dataset.driver)

    def files(self) -> list[str]:
        """Return the names of all files that GDAL reads for it, the sources of a VRT included."""
        with self._handles.borrow() as dataset:
            return list(dataset.files)

    def read_untouched(self, window: Window) -> tuple[NDArray[Any], NDArray[np.uint8] | None]:
        """Read all bands, (bands, h, w), and the mask, (h, w), of a window inside, without change.

        The mask is None if the raster has no mask band.
        """
        place = rasterio.windows.Window(*window)
        with self._handles.borrow() as dataset:
            mask = dataset.read_masks(1, window=place) if self.has_mask_band else None
            return read_values(dataset, self, place, range(1, self.count + 1)), mask


def open_raster(value: Any, *, allow_sensor_geometry: bool = False) -> RasterSource:
    """Open a raster for reading.

    Parameters
    ----------
    value
        A file, a URL, any name that GDAL understands (`/vsizip/…`, `NETCDF:…`), an open rasterio
        dataset, which stays open, a `Raster`, a numpy array or an `xarray.DataArray` (see
        `arrays.in_memory`).
    allow_sensor_geometry
        Accept images located by RPCs or GCPs only; their grid is in pixel coordinates.

    Raises
    ------
    RasterOpenError
        There is no such file, it cannot be read, or it has too many bands.
    GeoreferencingError
        See `metadata.grid_of`.
    """
    held = in_memory(value)
    if isinstance(held, Raster):
        return _source_of_array(held)
    name = os.fspath(raster_name(value)) if held is None else held.name
    handles = FileHandles(name) if held is None else OpenDataset(held)
    with handles.borrow() as dataset:
        if dataset.count == 0:
            inner = ", ".join(dataset.subdatasets[:3]) or "none"
            raise RasterOpenError(f"{name} holds no bands itself; open a raster inside it: {inner}")
        if dataset.count > MOST_BANDS:
            raise RasterOpenError(
                f"{name} has {dataset.count} bands; at most {MOST_BANDS} are read"
            )
        flags = stated(lambda: dataset.mask_flag_enums)
        bands = BandInfo.all_of(dataset)
        of_all = MaskFlags.per_dataset in flags[0] and MaskFlags.alpha not in flags[0]
        by_band = any(map(has_own_mask, flags, (band.nodata for band in bands)))
        interleaving = stated(lambda: dataset.interleaving)
        return RasterSource(
            path=name,
            grid=grid_of(name, dataset, allow_sensor_geometry=allow_sensor_geometry),
            bands=bands,
            has_mask_band=of_all or by_band,
            has_masks_by_band=by_band,
            interleave=interleaving.value.lower() if interleaving else None,
            colormap=colormap(dataset),
            # Drivers do not list all their domains: JPEG 2000 omits RPC.
            tags={
                ns: tags_of(dataset, ns=ns or None)
                for ns in dict.fromkeys(("", *stated(dataset.tag_namespaces), "RPC"))
            },
            _handles=handles,
            _overviews=RemoteOverviews(len(dataset.overviews(1)))
            if is_remote(name) and held is None
            else None,
        )


def _source_of_array(raster: Raster) -> RasterSource:
    transform = raster.transform
    if transform is None or (raster.crs is None and transform.is_identity):
        transform = PIXEL_COORDINATES
    band = BandInfo.plain(raster.values.dtype.name, raster.nodata)
    return RasterSource(
        path=raster.name,
        grid=Grid(transform, require_map(raster.crs), raster.width, raster.height),
        bands=(band,) * len(raster.bands),
        has_mask_band=np.ma.is_masked(raster.values),
        has_masks_by_band=_masks_differ(raster),
        interleave=None,
        colormap=None,
        tags={},
        _handles=ArrayHandles(raster),
    )


def _masks_differ(raster: Raster) -> bool:
    if not np.ma.is_masked(raster.values):
        return False
    first, *others = np.ma.getmaskarray(raster.bands)
    return any((mask != first).any() for mask in others)
