"""GeoTIFF files that keep the input's metadata of its pixels."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import Any

import rasterio.shutil
from numpy.typing import NDArray
from rasterio.enums import ColorInterp
from rasterio.io import MemoryFile

from ..arrays import Raster
from ..errors import ParameterError
from ..progress import SILENT, Progress
from ..runs import RUN_TAG, run_tags
from .atomic import scratch_file, scratch_folder, writing
from .grid import Grid
from .handles import FileHandles
from .hidden_files import final_name
from .metadata import BandInfo, fits
from .reading import RasterSource, open_raster
from .tiff_blocks import PixelType
from .tiff_directories import BLOCK, base_image
from .tiff_file import TiledFile, require_space
from .tiff_overviews import Reduced
from .tiling import in_order

# Metadata that belong to the input's file, or locate its pixels, and are not carried over.
_OWN_DOMAINS = ("IMAGE_STRUCTURE", "DERIVED_SUBDATASETS", "SUBDATASETS", "RPC", "GEOLOCATION")
_OWN_TAGS = ("NODATA_VALUES", RUN_TAG)

# File-name endings that request a Cloud Optimized GeoTIFF.
COG_SUFFIXES = (".cog.tif", ".cog.tiff")


@contextlib.contextmanager
def create_like(
    source: RasterSource,
    grid: Grid,
    path: str | os.PathLike[str],
    *,
    nodata: float | None,
    interleave: str | None = None,
    masked: bool = False,
    rpc_tags: Mapping[str, str] | None = None,
    workers: int = 2,
    progress: Progress = SILENT,
) -> Iterator[TiledFile]:
    """Create a tiled, compressed GeoTIFF with overviews, with the bands and metadata of a raster.

    Bands, dtype, colour interpretation, palette, descriptions, units, scales, offsets and tags
    are those of `source`. RPCs, GCPs and statistics are omitted, as they no longer hold. The file
    is the same for any number of workers.

    Parameters
    ----------
    source
        The raster whose bands and metadata are taken over.
    grid
        Grid of the new pixels.
    path
        The file to write; see `atomic.Outputs.stage`. If its final name ends in `COG_SUFFIXES`, it
        becomes a Cloud Optimized GeoTIFF: its blocks are copied once more.
    nodata
        Value of pixels without data, which their type can hold, or None.
    interleave
        "pixel" or "band"; by default as in the source.
    masked
        Whether a mask is written, too.
    rpc_tags
        RPCs that locate the raster, as in GDAL's metadata domain RPC.
    workers
        Number of threads that compress.
    progress
        Receives every tile of the overviews, which are made at the end of the `with` block.

    Yields
    ------
    TiledFile
        The file, to which all pixels must be written. Overviews are averages; nearest for palettes.

    Raises
    ------
    OutputError
        The file cannot be written completely.
    """
    path = Path(path)
    require_space(path, grid.width * grid.height * source.count * source.dtype.itemsize)
    names = {band.dtype for band in source.bands}
    # numpy has no name for GDAL's complex integers.
    pixels = PixelType(names.pop() if len(names) == 1 else source.dtype.name, source.dtype)
    profile = _profile(source, grid, nodata, interleave, pixels)
    with writing(path):
        template, beside = _template(source, profile, rpc_tags)
    whole = None if nodata is None or source.dtype.kind not in "iu" else int(nodata)
    levels = [base_image(template, grid.width, grid.height, masked, whole)]
    while max(levels[-1].width, levels[-1].height) > BLOCK:
        levels.append(levels[-1].overview())
    is_cog = final_name(path).lower().endswith(COG_SUFFIXES)
    with (
        scratch_file(path) if is_cog else contextlib.nullcontext(path) as first,
        ThreadPoolExecutor(workers) as pool,
        TiledFile(first, levels, pixels, source.count, pool, 2 * workers) as file,
    ):
        yield file
        _write_overviews(
            file,
            nearest=source.colormap is not None,
            nodata=nodata if whole is None else whole,
            progress=progress,
        )
        file.finish(len(levels))
        if is_cog:
            file.copy_as_cog(path)
    if beside is not None:
        with writing(path):
            Path(f"{os.fspath(path)}.aux.xml").write_bytes(beside)


def write_raster(
    path: Path,
    image: NDArray[Any],
    grid: Grid,
    band_names: Sequence[str],
    nodata: float | None = None,
    rpc_tags: Mapping[str, str] | None = None,
) -> None:
    """Write bands, shape (bands, rows, columns), as GeoTIFF, with RPCs if there are any.

    Raises
    ------
    OutputError
        The file cannot be written completely.
    """
    like = open_raster(Raster(image))
    kinds = (ColorInterp.gray, *repeat(ColorInterp.undefined, len(image) - 1))
    bands = tuple(
        replace(band, description=name, interpretation=kind)
        for band, name, kind in zip(like.bands, band_names, kinds, strict=True)
    )
    named = replace(like, bands=bands)
    with create_like(named, grid, path, nodata=nodata, rpc_tags=rpc_tags) as file:
        file.write(image)


def one_band(source: RasterSource, dtype: str) -> RasterSource:
    """Return a raster, for `create_like`, as one grey band of a dtype without other metadata."""
    band = BandInfo.plain(dtype)
    return replace(source, bands=(band,), has_mask_band=False, colormap=None, tags={})


def _profile(
    source: RasterSource,
    grid: Grid,
    nodata: float | None,
    interleave: str | None,
    pixels: PixelType,
) -> dict[str, Any]:
    colours = [band.interpretation for band in source.bands]
    rgb = colours[:3] == [ColorInterp.red, ColorInterp.green, ColorInterp.blue]
    by_band = (interleave or source.interleave) == "band"
    return {
        "driver": "GTiff",
        "width": BLOCK,
        "height": BLOCK,
        "count": source.count,
        "dtype": pixels.name,
        "nodata": nodata,
        "crs": grid.crs,
        "transform": grid.geotransform,
        "tiled": True,
        "blockxsize": BLOCK,
        "blockysize": BLOCK,
        "compress": "deflate",
        "predictor": pixels.predictor,
        "interleave": "band" if by_band else "pixel",
        "photometric": "RGB" if rgb else "MINISBLACK",
        "endianness": "LITTLE",
        "sparse_ok": True,
    }


def _template(
    source: RasterSource, profile: dict[str, Any], rpc_tags: Mapping[str, str] | None
) -> tuple[bytes, bytes | None]:
    """Return a GeoTIFF of one block with the metadata of the raster to be written.

    The second result is GDAL's `.aux.xml` with metadata that GeoTIFF cannot hold, such as some
    CRSs, or None.
    """
    with MemoryFile(ext=".tif") as memory:
        with memory.open(**profile) as dataset:
            _describe(dataset, source)
            dataset.update_tags(**run_tags(RUN_TAG))
            if rpc_tags is not None:
                dataset.update_tags(ns="RPC", **rpc_tags)
        with memory.open() as dataset:
            is_alone = not any(name.endswith(".aux.xml") for name in dataset.files)
        if is_alone:
            return bytes(memory.getbuffer()), None
        with scratch_folder() as folder:
            rasterio.shutil.copyfiles(memory.name, folder / "a.tif")
            return bytes(memory.getbuffer()), (folder / "a.tif.aux.xml").read_bytes()


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


def _write_overviews(
    file: TiledFile, *, nearest: bool, nodata: float | None, progress: Progress
) -> None:
    """Write all overviews, each from the previous level."""
    count = len(file.levels)
    for number in range(1, count):
        file.finish(number)
        part = progress.part((number - 1) / (count - 1), number / (count - 1))
        before = FileHandles(os.fspath(file.path), None if number == 1 else number - 2)
        with contextlib.closing(before) as handles:
            reduced = Reduced(handles, file.levels[number], nearest, nodata)
            tasks = reduced.tasks(file.bands)
            made = zip(tasks, in_order(file.executor, reduced.read, tasks, file.ahead), strict=True)
            for (bands, window), (values, valid) in part.over(made, len(tasks)):
                file.write(values, bands, window=window, valid=valid, level=number)


def shared_nodata(source: RasterSource) -> float | None:
    """Return the nodata value common to all bands of a raster, or None.

    A GeoTIFF has a single nodata value.

    Raises
    ------
    ParameterError
        Bands declare different nodata values, have different masks, or are of a type that cannot
        hold the value.
    """
    declared = [source.bands[number - 1].nodata for number in source.image_bands]
    # NaN is nodata, whether or not it is declared.
    if len({None if value != value else value for value in declared}) > 1:
        listed = ", ".join("none" if value is None else f"{value:g}" for value in declared)
        raise ParameterError(
            f"bands of {source.path} declare different nodata values ({listed}), and a GeoTIFF has "
            "one for all: give them the same (gdalwarp -dstnodata), or write them one by one"
        )
    if source.has_masks_by_band and len(declared) > 1:
        raise different_masks(source)
    nodata = next((value for value in declared if value is not None), None)
    if nodata is not None and not fits(nodata, source.dtype):
        raise ParameterError(f"pixels of type {source.dtype} cannot hold the nodata value {nodata}")
    return nodata


def chosen_nodata(source: RasterSource) -> float | None:
    """Return the nodata value for a raster's new pixels, or None.

    It is the declared value; for real floating-point pixels without declaration or mask, it is NaN,
    as they may be NaN where an alpha band is opaque. Errors as `shared_nodata`.
    """
    declared = shared_nodata(source)
    if declared is not None or source.has_mask_band:
        return declared
    return float("nan") if source.dtype.kind == "f" else None


def different_masks(source: RasterSource) -> ParameterError:
    """Return the error that bands lack data at different pixels, which one mask cannot express."""
    return ParameterError(
        f"bands of {source.path} hold no data at different pixels, and a GeoTIFF has one mask for "
        "all: mark them by a nodata value instead of masks, or write the bands one by one"
    )
