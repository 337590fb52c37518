"""Rasters: where they lie, reading windows of them, bringing them onto other grids, writing.

Where pixels lie
    `grid` (geotransforms and CRSs), `windows` (rectangles of pixels), `tiling` (rasters worked tile
    by tile), `target_grids` (which grid a registered raster gets).
Reading
    `reading` (a raster that is open), `metadata` (what it states of itself), `handles` (files, open
    datasets and arrays), `remote` (over a network), `remote_overviews` (reduced images there),
    `averaging` (means over larger pixels), `nodata` (which numbers hold no data), `raster_masks`
    (what rasters let take part), `radar_tags` (what states that it is a radar's).
Onto other grids
    `kernels` (interpolation), `lattice` (where all pixels of a grid lie in another image),
    `warping` (an image's values there).
What is matched
    `pair` (two images on one matching grid), `patch` (a piece of one), `held_images` (in memory,
    where they are read again and again), `colours` (classes of colour).
Heights
    `height_surfaces` (heights at any position, voids filled), `height_units` (heights in metres),
    `rendered` (terrain as the sun or a radar shows it).
Writing
    `delivery` (registered rasters), `writing` (a GeoTIFF like another raster), `tiff_file`,
    `tiff_directories`, `tiff_blocks` and `tiff_overviews` (its bytes), `whole` (a GeoTIFF of what
    memory holds anyway), `vrt` (virtual rasters),
    `atomic` (files that are whole or not there), `hidden_files` (until they are, and what dead runs
    left).
"""
