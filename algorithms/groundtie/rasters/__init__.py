"""Rasters: georeferencing, reading of windows, resampling onto other grids, writing.

Positions of pixels
    `grid` (geotransforms and CRSs), `windows` (rectangles of pixels), `tiling` (processing tile by
    tile), `target_grids` (grids of registered rasters).
Reading
    `reading` (open rasters), `metadata` (grid, bands and types), `handles` (files, open datasets
    and arrays), `remote` (over a network), `remote_overviews` (reduced images there), `averaging`
    (means over larger pixels), `nodata` (numbers without data), `raster_masks` (mask rasters),
    `radar_tags` (radar metadata).
Resampling
    `kernels` (interpolation), `lattice` (positions of all pixels of a grid in another image),
    `warping` (an image's values there).
Images to match
    `pair` (two images on one matching grid), `patch` (a piece of an image), `held_images` (images
    in memory, for repeated reading), `colours` (classes of colour).
Heights
    `height_surfaces` (heights at any position, voids filled), `height_units` (heights in metres),
    `rendered` (terrain models rendered as images).
Writing
    `delivery` (registered rasters), `writing` (a GeoTIFF like another raster, or of an array),
    `tiff_file`, `tiff_directories`, `tiff_blocks` and `tiff_overviews` (its bytes), `vrt` (virtual
    rasters), `atomic` (atomic outputs), `hidden_files` (temporary files and leftovers).
"""
