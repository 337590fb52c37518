"""Rasters: where they lie, reading windows of them, bringing them onto other grids, writing."""
