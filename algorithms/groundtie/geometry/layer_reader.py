"""Reading of a vector layer with fiona, in a separate process.

`vector_layers` starts this file as a script, so that it imports nothing from the package.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any


def layer_of(path: str) -> dict[str, Any]:
    """Return the first layer of a vector file as values that JSON can carry.

    The keys are `crs_wkt`, `fields` (names of the attributes) and `features`, each with `geometry`
    (None, or `type` and `coordinates` or `geometries` as GeoJSON has them) and `properties`; or
    `error`, why the file cannot be read.
    """
    import fiona

    try:
        with fiona.open(path) as layer:
            return {
                "crs_wkt": layer.crs_wkt,
                "fields": list(layer.schema["properties"]),
                "features": [
                    {
                        "geometry": _plain(feature["geometry"]),
                        "properties": dict(feature["properties"]),
                    }
                    for feature in layer
                ],
            }
    except UnicodeDecodeError:
        return {"error": "its texts are not in UTF-8"}
    # A damaged file may raise any class of error.
    except Exception as error:
        return {"error": str(error) or type(error).__name__}


def _plain(geometry: Any) -> dict[str, Any] | None:
    if geometry is None:
        return None
    if geometry["type"] == "GeometryCollection":
        parts = filter(None, map(_plain, geometry["geometries"] or ()))
        return {"type": geometry["type"], "geometries": list(parts)}
    if geometry.get("coordinates") is None:
        return None
    return {"type": geometry["type"], "coordinates": geometry["coordinates"]}


if __name__ == "__main__":
    # Modules beside this one must not shadow others (Python 3.10 lacks the option -P).
    sys.path[:] = [folder for folder in sys.path if folder != os.path.dirname(__file__)]
    # Dates and binary attributes are not used; as text they do no harm.
    json.dump(layer_of(sys.argv[1]), sys.stdout, default=str)
