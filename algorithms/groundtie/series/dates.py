"""The opened dates of a series: their pixels, kinds of sensor, and footprints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, combinations
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from rasterio.features import shapes
from shapely.geometry import Polygon
from shapely.ops import unary_union

from ..context import Context
from ..errors import CancelledError, GroundTieError
from ..masks.radar import LEAST_VARIATION2, variation2_of
from ..memory import DATES_SHARE, share_bytes
from ..raster_names import facts_behind
from ..rasters.grid import FloatArray, Grid, compose, near_longitude, reproject
from ..rasters.held_images import held_grey
from ..rasters.pair import Image
from ..rasters.radar_tags import is_known_radar
from ..rasters.reading import RasterSource, open_raster
from ..registration.user_masks import UserMask, draw_mask
from ..report.pictures import overview_grid
from ..runs import digest, file_facts, unknown_facts
from ..vrt_sources import sources_of
from .inputs import Listed

# Footprints are drawn on images reduced to this longer side.
_FOOTPRINT_PX = 256

# Files of a shapefile that hold the index of its shapes, and their CRS.
_PARTS_OF_SHAPEFILE = (".shx", ".prj")

# Prefix of the tags in which GDAL keeps statistics.
_STATISTICS = "STATISTICS_"

# Domains of tags that repeat the file's name as it was given, or hold documents, as a VRT's XML.
_NAMING_DOMAINS = ("DERIVED_SUBDATASETS", "SUBDATASETS", "xml:")


@dataclass(frozen=True)
class Date:
    """One date of a series.

    Parameters
    ----------
    listed
        The date as the user named it.
    source
        The raster as in its file.
    matched
        The image that is matched: the raster itself, or its grey image in memory.
    drawn
        The image with its mask on its own pixels; None: it has no mask, or each pair makes it.
    """

    listed: Listed
    source: RasterSource
    matched: Image
    drawn: Image | None = None

    @property
    def name(self) -> str:
        """The date's name."""
        return self.listed.name

    def image(self, grid: Grid) -> Image:
        """Return the matched image as if its pixels lay on another grid of the same size."""
        return replace(self.matched, source=replace(self.matched.source, grid=grid))

    def masked(self, image: Image) -> Image:
        """Return its image in a pair with its mask, on the image's grid."""
        if self.drawn is None or self.drawn.mask is None:
            return image
        moved = replace(self.drawn.mask, grid=image.source.grid)
        note, hides = self.drawn.mask_note, self.drawn.mask_hides
        return replace(image, mask=moved, mask_note=note, mask_hides=hides)

    @property
    def pair_mask(self) -> UserMask | None:
        """The mask that each pair makes; None: there is none."""
        return None if self.drawn is not None else self.listed.mask

    @cached_property
    def is_radar(self) -> bool:
        """Whether its metadata or its speckle are those of a radar image."""
        if is_known_radar(self.source):
            return True
        return variation2_of(self.matched) >= LEAST_VARIATION2

    @cached_property
    def facts(self) -> tuple[Any, ...]:
        """Facts that determine its pixels and their place: files behind it, and metadata."""
        return raster_facts(self.listed.raster, self.source)

    @cached_property
    def mask_facts(self) -> tuple[Any, ...]:
        """Facts that determine its mask and the mask's place, as `facts`."""
        mask = self.listed.mask
        if mask is None:
            return (None,)
        if mask.is_raster:
            with open_raster(mask.mask) as source:
                return raster_facts(mask.mask, source), mask.values
        parts = chain.from_iterable(map(_facts_of, parts_of_layer(mask.mask)))
        return *parts, mask.values

    @cached_property
    def key(self) -> str:
        """Digest of its files' place, size and time, of its georeferencing, and of its mask."""
        return digest(self.facts, *self.mask_facts)

    def read(self, with_footprint: bool) -> None:
        """Read all that the series needs of the date, so that an error fails this date alone.

        Parameters
        ----------
        with_footprint
            Whether to read the footprint, too, which takes all pixels.
        """
        _ = self.is_radar, self.facts, self.mask_facts, with_footprint and self.rings

    @cached_property
    def rings(self) -> list[FloatArray]:
        """Outlines of its valid pixels on its own map, each of shape (n, 2)."""
        source, band = self.matched.source, self.matched.band
        small = overview_grid(source.grid, _FOOTPRINT_PX)
        _, valid = source.read(source.window, band, (small.height, small.width))
        # The pixels read are a whole number along either side, those of `small` square.
        scale = Affine.scale(source.grid.width / small.width, source.grid.height / small.height)
        found = shapes(
            valid.astype(np.uint8), valid, transform=compose(source.grid.transform, scale)
        )
        return [np.array(geometry["coordinates"][0]) for geometry, _ in found]

    def footprint(self, grid: Grid) -> Any:
        """Return the outline of its valid pixels as a shapely polygon on the map of a grid.

        Longitudes are those nearest to the grid's.
        """
        middle, crs = grid.pixel_to_map([grid.centre_px])[0, 0], grid.crs
        rings = (reproject(ring, self.source.grid.crs, crs) for ring in self.rings)
        moved = [Polygon(near_longitude(ring, middle, crs)) for ring in rings]
        sound = [polygon.buffer(0) for polygon in moved if np.isfinite(polygon.bounds).all()]
        return unary_union(sound)


def open_dates(
    listed: Sequence[Listed],
    band: int | None,
    stack: ExitStack,
    context: Context,
    *,
    with_footprints: bool = True,
) -> tuple[list[Date], dict[str, str]]:
    """Open the rasters of a series; rasters that cannot be read are left out.

    Returns the dates that could be opened, and the errors of the others by name.

    Parameters
    ----------
    listed
        The dates, the reference among them.
    band
        Number of the band that is matched, from 1; None: the mean of all.
    stack
        Keeps the rasters open.
    context
        Progress.
    with_footprints
        Whether footprints will be needed.
    """
    dates: list[Date] = []
    failures: dict[str, str] = {}
    held_bytes, most_bytes = 0, share_bytes(DATES_SHARE)
    for number, one in enumerate(listed):
        context.update(number / len(listed), f"opening {one.name}")
        try:
            source = stack.enter_context(open_raster(one.raster))
            held_bytes += source.grid.width * source.grid.height * np.dtype(np.float32).itemsize
            drawn = None
            if one.mask is not None and one.mask.is_drawn:
                drawn = draw_mask(source, one.mask, stack, context.quiet().progress)
                context.update(number / len(listed), drawn.mask_note)
            matched = Image(source, band)
            if held_bytes <= most_bytes:
                matched = Image(held_grey(source, band))  # of the band that is matched alone
            date = Date(one, source, matched, drawn)
            date.read(with_footprints)
            dates.append(date)
        except CancelledError:
            raise
        except GroundTieError as error:
            failures[one.name] = error.one_line()
    return dates, failures


def footprint_shares(polygons: Sequence[Any]) -> dict[frozenset[int], float]:
    """Return the overlap of footprints as a share of the smaller of two; 0 is left out.

    Parameters
    ----------
    polygons
        The footprint of each date, on one map.
    """
    found = {}
    for (first, one), (second, other) in combinations(enumerate(polygons), 2):
        common = one.intersection(other).area
        if common > 0:
            found[frozenset((first, second))] = float(common / min(one.area, other.area))
    return found


def raster_facts(raster: Any, source: RasterSource) -> tuple[Any, ...]:
    """Return facts that determine a raster's pixels and their place: its files and its metadata.

    Viewers write statistics into a raster's `.aux.xml`: that file counts by the raster's metadata
    without statistics. A raster on a server counts by its name and metadata. A raster whose files
    are not found never counts as unchanged.

    Parameters
    ----------
    raster, source
        The raster as it was named, and opened.
    """
    behind: list[Path | str] = []
    if isinstance(raster, (str, Path)):
        behind = [name for name in source.files() if not name.endswith(".aux.xml")]
    if isinstance(raster, Path):
        behind += sources_of(raster)
    facts = chain(_facts_of(raster), *map(facts_behind, behind))
    return *facts, source.grid.to_json(), *_stated(source)


def _facts_of(named: Any) -> list[tuple[Any, ...]]:
    """Return the facts of a raster or a layer as it was named; in memory, they are unknown."""
    if isinstance(named, Path):
        return [file_facts(named)]
    return facts_behind(named) if isinstance(named, str) else [unknown_facts(named.name)]


def _stated(source: RasterSource) -> tuple[Any, ...]:
    """Return a raster's metadata on its pixels, without statistics."""
    bands = [{**vars(band), "tags": _without_statistics(band.tags)} for band in source.bands]
    tags = [
        (domain, _without_statistics(found))
        for domain, found in sorted(source.tags.items())
        if not domain.startswith(_NAMING_DOMAINS)
    ]
    masks = source.has_mask_band, source.has_masks_by_band
    return bands, masks, source.colormap, tags


def _without_statistics(tags: Mapping[str, str]) -> list[tuple[str, str]]:
    return sorted(one for one in tags.items() if not one[0].startswith(_STATISTICS))


def parts_of_layer(layer: Any) -> list[Any]:
    """Return the files of a vector layer or a classifier: a shapefile has several."""
    if not isinstance(layer, Path) or layer.suffix.lower() != ".shp":
        return [layer]
    return [layer, *(layer.with_suffix(ending) for ending in _PARTS_OF_SHAPEFILE)]
