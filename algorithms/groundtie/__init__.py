"""GroundTie registers satellite images to one another, above all SAR and optical ones.

Tools are functions (`coregister`, `warp`, `simulate`, …) of files, arrays (`Raster`) and open
datasets; see `groundtie.tools`. `load_transform` reads the transform that a registration wrote.

Decisions and their reasons are logged under this package's name: steps at level INFO, rejected tie
points at DEBUG, output beyond the overlap at WARNING. Without a handler of the caller's, nothing
is shown.
"""

from __future__ import annotations

import importlib
import logging
from typing import TYPE_CHECKING, Any

from .version import __version__

if TYPE_CHECKING:
    from .arrays import Raster
    from .geometry.transform import load_transform
    from .tools.assess import assess
    from .tools.assess_sensor import assess_sensor
    from .tools.batch import batch
    from .tools.coregister import coregister
    from .tools.coregister_series import coregister_series, register_series
    from .tools.detector_repeatability import detector_repeatability
    from .tools.doctor import doctor
    from .tools.estimate_rotation import estimate_rotation
    from .tools.extract_gcps import extract_gcps
    from .tools.filter_speckle import filter_speckle
    from .tools.mask_ground import mask_ground
    from .tools.mask_regions import mask_regions
    from .tools.mask_surface import mask_surface
    from .tools.mask_threshold import mask_threshold
    from .tools.match_optical import match_optical
    from .tools.match_sar_sar import match_sar_sar
    from .tools.orthorectify import orthorectify
    from .tools.refine_rpc import refine_rpc
    from .tools.register import register
    from .tools.similarity_surface import similarity_surface
    from .tools.simulate import simulate
    from .tools.simulate_sensor import simulate_sensor
    from .tools.train_feature_classifier import train_feature_classifier
    from .tools.warp import warp

__all__ = [
    "Raster",
    "__version__",
    "assess",
    "assess_sensor",
    "batch",
    "coregister",
    "coregister_series",
    "detector_repeatability",
    "doctor",
    "estimate_rotation",
    "extract_gcps",
    "filter_speckle",
    "load_transform",
    "mask_ground",
    "mask_regions",
    "mask_surface",
    "mask_threshold",
    "match_optical",
    "match_sar_sar",
    "orthorectify",
    "refine_rpc",
    "register",
    "register_series",
    "similarity_surface",
    "simulate",
    "simulate_sensor",
    "train_feature_classifier",
    "warp",
]

# Loaded on first use: importing groundtie must stay cheap for the command line's help and QGIS.
_HOMES = {
    "Raster": ".arrays",
    "load_transform": ".geometry.transform",
    "register_series": ".tools.coregister_series",
}

logging.getLogger(__name__).addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES.get(name, f".tools.{name}")
    return getattr(importlib.import_module(home, __name__), name)
