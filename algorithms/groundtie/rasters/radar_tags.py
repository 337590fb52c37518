"""What the metadata of a raster state of radar."""

from __future__ import annotations

from dataclasses import replace

from .reading import RasterSource

# Tag of a raster, in GDAL's default domain, that states by what its speckle was filtered.
SPECKLE_FILTER = "SPECKLE_FILTER"


def with_speckle_filter(source: RasterSource, how: str) -> RasterSource:
    """Return a raster, for `create_like`, whose tags state by what its speckle was filtered."""
    default = source.tags.get("", {}) | {SPECKLE_FILTER: how}
    return replace(source, tags={**source.tags, "": default})


def is_known_radar(source: RasterSource) -> bool:
    """Return whether complex pixels or the tag of a speckle filter leave no doubt of a radar's.

    False indicates nothing: most software keeps no such tag.
    """
    return source.is_complex or SPECKLE_FILTER in source.tags.get("", {})
