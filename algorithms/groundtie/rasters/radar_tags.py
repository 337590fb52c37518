"""Radar metadata of a raster."""

from __future__ import annotations

from dataclasses import replace

from .reading import RasterSource

# Tag of a raster, in GDAL's default domain, that names its speckle filter.
SPECKLE_FILTER = "SPECKLE_FILTER"


def with_speckle_filter(source: RasterSource, how: str) -> RasterSource:
    """Return a raster, for `create_like`, whose tags name its speckle filter."""
    default = source.tags.get("", {}) | {SPECKLE_FILTER: how}
    return replace(source, tags={**source.tags, "": default})


def is_known_radar(source: RasterSource) -> bool:
    """Return whether complex pixels or a speckle-filter tag prove that the image is of a radar.

    False is inconclusive: most software keeps no such tag.
    """
    return source.is_complex or SPECKLE_FILTER in source.tags.get("", {})
