"""rasterio's orthorectification by RPCs, which is GDAL's warper: the same as `gdalwarp -rpc`.

Run as `python gdal_ortho.py IMAGE DEM LIKE RESAMPLING TOLERANCE_PX OUTPUT`; LIKE has the grid that
is made. Two threads; prints nothing.
"""

import sys

import rasterio
from rasterio.warp import Resampling, reproject

THREADS = 2
MEMORY_MB = 256


def main(image, dem, like, resampling, tolerance_px, output):
    with rasterio.open(like) as grid, rasterio.open(image) as source:
        profile = {
            "driver": "GTiff", "width": grid.width, "height": grid.height, "count": source.count,
            "dtype": source.dtypes[0], "crs": grid.crs, "transform": grid.transform, "tiled": True,
            "compress": "deflate", "zlevel": 1, "predictor": 2, "num_threads": THREADS,
        }  # fmt: skip
        with rasterio.open(output, "w", **profile) as target:
            reproject(
                rasterio.band(source, list(source.indexes)),
                rasterio.band(target, list(source.indexes)),
                rpcs=source.rpcs,
                src_crs="EPSG:4326",
                dst_crs=grid.crs,
                dst_transform=grid.transform,
                resampling=Resampling[resampling],
                num_threads=THREADS,
                warp_mem_limit=MEMORY_MB,
                tolerance=float(tolerance_px),
                RPC_DEM=dem,
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
