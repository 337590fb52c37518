"""What the metadata of a raster say of radar."""

from __future__ import annotations

from dataclasses import replace

from .reading import BandInfo, RasterSource

# Tag of a raster, in GDAL's default domain, that tells by what its speckle was filtered.
SPECKLE_FILTER = "SPECKLE_FILTER"

# Tags of bands in which GDAL's readers of radar products tell the polarisation, and its values.
_POLARISATION_TAGS = ("POLARIMETRIC_INTERP", "POLARIZATION")
_POLARISATIONS = ("HH", "HV", "VH", "VV")


def with_speckle_filter(source: RasterSource, how: str) -> RasterSource:
    """Return a raster, for `create_like`, whose tags say by what its speckle was filtered."""
    default = source.tags.get("", {}) | {SPECKLE_FILTER: how}
    return replace(source, tags={**source.tags, "": default})


def is_known_radar(source: RasterSource, band: int | None = None) -> bool:
    """Tell whether a raster's metadata leave no doubt that it is a radar's.

    Parameters
    ----------
    source
        The raster.
    band
        Number of the band, from 1; None: all that are not alpha.

    Returns
    -------
    bool
        True if the pixels are complex, or the speckle was filtered, or the bands have the
        polarisation of waves that were sent and received. False says nothing: most tools keep
        no such tags.

    Raises
    ------
    BandError
        There is no such band.
    """
    if source.is_complex or SPECKLE_FILTER in source.tags.get("", {}):
        return True
    numbers = source.image_bands if band is None else (band,)
    return all(_has_polarisation(source.band_info(number)) for number in numbers)


def _has_polarisation(band: BandInfo) -> bool:
    return any(band.tags.get(tag) in _POLARISATIONS for tag in _POLARISATION_TAGS)
