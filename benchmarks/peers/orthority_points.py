"""orthority's RPC camera on given points: times, and where it sees them.

Run as `python orthority_points.py POINTS.npz`; writes POINTS.out.npy, prints the seconds as JSON.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
from orthority.camera import RpcCamera
from rasterio.rpc import RPC

TIMES = 3


def best(work):
    seconds = []
    for _ in range(TIMES):
        started = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - started)
    return min(seconds), result


def main(path):
    given = np.load(path)
    rpc = RPC.from_gdal(json.loads(str(given["tags"])))
    camera = RpcCamera((1000, 1000), rpc)
    xyz = np.vstack([given["ground"].T, given["height"]])
    forward, ji = best(lambda: camera.world_to_pixel(xyz))
    inverse, _ = best(lambda: camera.pixel_to_world_z(given["px"].T, given["height"]))
    np.save(Path(path).with_suffix(".out.npy"), ji.T)
    print(json.dumps({"forward": forward, "inverse": inverse}))


if __name__ == "__main__":
    main(sys.argv[1])
