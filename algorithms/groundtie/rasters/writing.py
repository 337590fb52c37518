"""GeoTIFF files that carry over all that the input states of its pixels."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import rasterio.shutil
from rasterio.enums import ColorInterp, Resampling
from rasterio.env import GDALVersion

from ..errors import ParameterError, raised_by
from .atomic import writing
from .bands import BandInfo, fits
from .grid import PIXEL_COORDINATES, Grid
from .reading import CACHE_BYTES, RasterSource

BLOCK = 512

# Metadata that belong to the file, or locate the pixels, of the input only.
_OWN_DOMAINS = ("IMAGE_STRUCTURE", "DERIVED_SUBDATASETS", "SUBDATASETS", "RPC", "GEOLOCATION")
_OWN_TAGS = ("NODATA_VALUES",)


@contextlib.contextmanager
def create_like(
    source: RasterSource,
    grid: Grid,
    path: str | os.PathLike[str],
    *,
    nodata: float | None,
    interleave: str | None = None,
    workers: int = 2,
) -> Iterator[Any]:
    """Create a tiled, compressed GeoTIFF with overviews, with the bands and metadata of a raster.

    Bands, dtype, colour interpretation, palette, descriptions, units, scales, offsets and tags
    are those of `source`. RPCs, GCPs and statistics are left out: they are no longer true.

    Parameters
    ----------
    source
        The raster that is imitated.
    grid
        Where the new pixels lie.
    path
        The file to write; see `atomic.Outputs.stage`.
    nodata
        Value of pixels without data, or None.
    interleave
        "pixel" or "band"; by default as in the source.
    workers
        Threads that compress.

    Yields
    ------
    rasterio dataset, open for writing
        Overviews (averages; nearest for palettes) are made when the block ends.

    Raises
    ------
    ParameterError
        The pixel type cannot hold `nodata`.
    OutputError
        The file cannot be written completely.
    """
    if nodata is not None:
        require_fit(nodata, source.dtype)
    interleave = interleave or source.interleave or "pixel"
    if interleave.lower() == "band" and not GDALVersion.runtime().at_least("3.8"):
        # Threads of older GDAL that read such a file report by an ERROR each that its bands are
        # unknown (OSGeo/gdal issue 7921), past every handler, and are right nonetheless.
        workers = 1
    profile = _profile(source, grid, nodata, interleave, workers)
    # A mask inside the file, not beside it.
    options = {
        "GDAL_TIFF_INTERNAL_MASK": True,
        "GDAL_CACHEMAX": CACHE_BYTES,
        "GDAL_NUM_THREADS": workers,
    }
    with writing(path), rasterio.Env(**options):
        with rasterio.open(path, "w", **profile) as dataset:
            _describe(dataset, source)
            yield dataset
            # Before it is closed: the compression is that of the pixels.
            _add_overviews(dataset, nearest=source.colormap is not None)
        check_complete(path)


def one_band(source: RasterSource, dtype: str) -> RasterSource:
    """Return a raster, for `create_like`, as one grey band of a dtype without anything else."""
    band = BandInfo.plain(dtype)
    return replace(source, bands=(band,), has_mask_band=False, colormap=None, tags={})


def write_cog(source: str | os.PathLike[str], path: str | os.PathLike[str], workers: int) -> None:
    """Copy a GeoTIFF of `create_like` into a Cloud Optimized GeoTIFF.

    Parameters
    ----------
    source, path
        The file that is read, and the one that is written; see `atomic.Outputs.stage`.
    workers
        Threads that compress.

    Raises
    ------
    OutputError
        The file cannot be written completely.
    """
    options = {"blocksize": BLOCK, "compress": "deflate", "level": 1, "bigtiff": "if_safer"}
    with writing(path), rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES):
        rasterio.shutil.copy(
            source, path, driver="COG", predictor="yes", num_threads=workers, **options
        )
        check_complete(path)


def check_complete(path: str | os.PathLike[str]) -> None:
    """Raise `OutputError` if a GeoTIFF lacks pixels: GDAL may meet a full disk in silence."""
    with writing(path):
        try:
            complete = all(_block_ends(path, Path(path).stat().st_size))
        except Exception as error:
            if not raised_by(error, "rasterio"):
                raise
            complete = False
        if not complete:
            raise OSError("the file is not complete; is the disk full?")


def _block_ends(path: str | os.PathLike[str], size: int) -> Iterator[bool]:
    """Yield for each block, of the image and its overviews, whether it lies within the file."""
    with rasterio.open(path) as dataset:
        bands = dataset.indexes if dataset.interleaving.value == "BAND" else [1]
        factors = [1, *dataset.overviews(1)]
        for level, factor in zip([None, *range(len(factors))], factors, strict=False):
            rows = _blocks(-(-dataset.height // factor))
            cols = _blocks(-(-dataset.width // factor))
            for band, row, col in itertools.product(bands, range(rows), range(cols)):
                end = _block_end(dataset, band, level, col, row)
                yield end is not None and end <= size


def _blocks(pixels: int) -> int:
    return -(-pixels // BLOCK)


def _block_end(dataset: Any, band: int, level: int | None, col: int, row: int) -> int | None:
    place = f"{col}_{row}"
    start, length = (
        dataset.get_tag_item(f"BLOCK_{what}_{place}", "TIFF", bidx=band, ovr=level)
        for what in ("OFFSET", "SIZE")
    )
    return None if start is None or length is None else int(start) + int(length)


def _profile(
    source: RasterSource, grid: Grid, nodata: float | None, interleave: str, workers: int
) -> dict[str, Any]:
    kind, bits = source.dtype.kind, source.dtype.itemsize * 8
    by_kind = {"f": 3, "c": 1}
    predictor = by_kind.get(kind, 2 if bits < 64 else 1)
    names = {band.dtype for band in source.bands}
    colours = [band.interpretation for band in source.bands]
    rgb = colours[:3] == [ColorInterp.red, ColorInterp.green, ColorInterp.blue]
    profile = {
        "driver": "GTiff",
        "width": grid.width,
        "height": grid.height,
        "count": source.count,
        # GDAL's complex integers have no name in numpy.
        "dtype": names.pop() if len(names) == 1 else source.dtype.name,
        "nodata": nodata,
        "crs": grid.crs,
        "tiled": True,
        "blockxsize": BLOCK,
        "blockysize": BLOCK,
        "compress": "deflate",
        "zlevel": 1,
        "predictor": predictor,
        "interleave": interleave,
        "bigtiff": "IF_SAFER",
        "num_threads": workers,
        "photometric": "RGB" if rgb else "MINISBLACK",
    }
    if grid.crs is not None or grid.transform != PIXEL_COORDINATES:
        profile["transform"] = grid.transform
    return profile


def _describe(dataset: Any, source: RasterSource) -> None:
    bands = source.bands
    if source.colormap is None:
        dataset.colorinterp = [band.interpretation for band in bands]
    else:
        dataset.write_colormap(1, source.colormap)
    for domain, tags in source.tags.items():
        if domain not in _OWN_DOMAINS and not domain.startswith("xml:"):
            kept = {key: text for key, text in tags.items() if key not in _OWN_TAGS}
            dataset.update_tags(ns=domain or None, **kept)
    for number, band in enumerate(bands, start=1):
        kept = {key: text for key, text in band.tags.items() if not key.startswith("STATISTICS_")}
        dataset.update_tags(number, **kept)
        if band.description:
            dataset.set_band_description(number, band.description)
    dataset.scales = [band.scale for band in bands]
    dataset.offsets = [band.offset for band in bands]
    if any(band.unit for band in bands):
        dataset.units = [band.unit or "" for band in bands]


def _add_overviews(dataset: Any, *, nearest: bool) -> None:
    factors: list[int] = []
    size = max(dataset.width, dataset.height)
    while size > BLOCK:
        factors.append(2 << len(factors))
        size = -(-size // 2)
    if factors:
        dataset.build_overviews(factors, Resampling.nearest if nearest else Resampling.average)


def require_fit(nodata: float, dtype: np.dtype[Any]) -> None:
    """Raise `ParameterError` if pixels of a type cannot hold a nodata value."""
    if not fits(nodata, dtype):
        raise ParameterError(f"pixels of type {dtype} cannot hold the nodata value {nodata}")


def fill_value(source: RasterSource, nodata: float | None, band: int) -> Any:
    """Return what stands in a band, numbered from 1, where there is no data."""
    dtype = source.dtype
    return dtype.type(0) if nodata is None or band == source.alpha_band else dtype.type(nodata)


def keep_apart(values: np.ndarray[Any, Any], fill: Any) -> None:
    """Change valid values that happen to equal the nodata value, in place, by the least step."""
    if values.dtype.kind == "f":
        neighbour = np.nextafter(fill, values.dtype.type(np.inf))
    elif values.dtype.kind == "c":
        neighbour = fill + np.finfo(values.dtype).tiny
    else:
        neighbour = fill + 1 if fill < np.iinfo(values.dtype).max else fill - 1
    values[values == fill] = neighbour
