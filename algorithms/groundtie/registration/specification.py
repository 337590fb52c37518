"""The specification of a registration: one value that every stage of the pipeline reads."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..geometry.models import KINDS, PARAMETERS
from ..geometry.views import RADAR, View
from ..kinds import AUTO
from ..masks.used import INPUT, REFERENCE
from ..matching.alignment import MODEL_CANDIDATES
from ..raster_names import file_name
from ..rasters.rendered import Light
from ..similarity.surface import SIMILARITIES

# How the tie points of the fit are matched: by chips alone; by keypoints, refined by chips around
# them; by chips all over around a model of keypoints.
CHIPS, KEYPOINTS, GUIDED_CHIPS = "chips", "keypoints", "guided-chips"
MATCHERS = (CHIPS, KEYPOINTS, GUIDED_CHIPS)

# Which images are declared to be a radar's; by default this is inferred from the images.
BOTH, NEITHER = "both", "neither"


@dataclass(frozen=True)
class FreeSearch:
    """Search limits for images without any georeferencing.

    Parameters
    ----------
    radius_share
        Largest shift, as a share of the input's longer side; None: as for georeferenced images.
    rotation_deg
        Largest rotation, either way.
    scale
        Largest scale, either way.
    """

    radius_share: float | None = None
    rotation_deg: float = 0.0
    scale: float = 1.0


# A quarter of the side, any rotation, half to twice the size.
ANYWHERE = FreeSearch(0.25, 180.0, 2.0)


@dataclass(frozen=True)
class StatedSurface:
    """The elevated objects of a scene, and the views of the images.

    Parameters
    ----------
    model
        A raster of heights, or a vector layer of buildings with their heights.
    views
        The view of the reference, then that of the input if it is known.
    """

    model: Any
    views: tuple[View, ...]

    @property
    def name(self) -> str:
        """The model's name in messages."""
        is_file = isinstance(self.model, (str, Path))
        return file_name(str(self.model)) if is_file else "the surface model"

    @property
    def radar(self) -> str:
        """Which image is a radar's, as a value of `Specification.radar`."""
        is_radar = [view.sensor == RADAR for view in self.views]
        if all(is_radar):
            return BOTH
        return (REFERENCE if is_radar[0] else INPUT) if any(is_radar) else NEITHER


# Allowed words of fields.
_WORDS: dict[str, tuple[str, ...]] = {
    "matcher": MATCHERS,
    "similarity": SIMILARITIES,
    "refinement": SIMILARITIES,
    "model": (AUTO, *KINDS),
    "candidates": tuple(PARAMETERS),
    "radar": (AUTO, REFERENCE, INPUT, BOTH, NEITHER),
}


@dataclass(frozen=True)
class Specification:
    """How a pair is registered; the registering tools are presets of it.

    Parameters
    ----------
    matcher
        One of `MATCHERS`.
    similarity
        One of `similarity.surface.SIMILARITIES`: the measure for chips of the fit, the coarse
        shift and check chips.
    refinement
        The measure for chips that refine keypoints.
    model
        One of `models.KINDS`, or "auto" for the simplest polynomial that the points justify.
    candidates
        The models that "auto" chooses from with the matcher "chips", from simple to flexible.
    max_error_px
        Largest root mean square error at check points, in pixels of the coarser image, or of
        `matching_pixel_size_m` if that is stated.
    search_radius_m
        How far the input may lie from its nominal place; None: 100 m or 20 pixels.
    rotation_deg, scale
        How far it may be rotated and scaled, either way; None: not at all, or as `free` states.
    free
        Search limits without georeferencing.
    radar
        Which image is a radar's, "reference", "input", "both" or "neither", for tools that are
        made for such pairs; "auto": inferred from metadata and speckle.
    surface
        The elevated objects of the scene; None: unknown.
    matching_pixel_size_m
        Pixel size of the matching grid; None: that of the coarser image, `enlargement` times.
    tries
        How many registrations of this pair were tried, this one included. The probability of
        agreement by chance counts all of them.
    dem, input_dem
        Terrain models, as `open_raster` takes them: heights of the ground, and those that the input
        was orthorectified with (None: one height everywhere). With the first, "auto" may choose
        `models.TERRAIN`, which only the matcher "chips" supports.
    light
        The reference is a terrain model and is rendered in this light; None: it is no terrain
        model.
    surface_view
        The reference is a surface model and is rendered as a radar image from this view, with
        layover, radar shadow and double bounce; None: it is no surface model.
    is_placed
        Whether other registrations, which all rules accepted, have placed both images. Tie points
        are then searched for from there, and no survey is made.

    Raises
    ------
    ParameterError
        A value is none of the allowed words, or no finite number from 0 on.
    """

    matcher: str = CHIPS
    similarity: str = "fused"
    refinement: str = "fused"
    model: str = AUTO
    candidates: tuple[str, ...] = MODEL_CANDIDATES
    max_error_px: float = USUAL_MAX_ERROR_PX
    search_radius_m: float | None = None
    rotation_deg: float | None = None
    scale: float | None = None
    free: FreeSearch = FreeSearch()
    radar: str = AUTO
    surface: StatedSurface | None = None
    matching_pixel_size_m: float | None = None
    tries: int = 1
    dem: Any = None
    input_dem: Any = None
    light: Light | None = None
    surface_view: View | None = None
    is_placed: bool = False

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            words = value if name == "candidates" else (value,)
            known = _WORDS.get(name)
            if known is not None and value != field.default and not set(words) <= set(known):
                raise ParameterError(f"{name} must be one of {', '.join(known)}, not {value!r}")
            if isinstance(value, (int, float)) and not 0 <= value < math.inf:
                raise ParameterError(f"{name} must be a finite number from 0 on, not {value!r}")

    @property
    def is_rendered(self) -> bool:
        """Whether the reference holds heights, from which an image is rendered."""
        return self.light is not None or self.surface_view is not None

    @property
    def enlargement(self) -> float:
        """Ratio of the size of matching pixels to that of the coarser image's pixels."""
        is_stated = self.matching_pixel_size_m is not None
        return 1.0 if self.light is None or is_stated else self.light.enlargement

    @property
    def largest_error_px(self) -> float:
        """`max_error_px` in matching pixels."""
        return self.max_error_px / self.enlargement


# Presets of the three tools (see `tools`). Without georeferencing, images may lie a quarter of
# their side off, SAR images may have any rotation, and optical images another scale besides.
COREGISTER = Specification()
SAR_SAR = Specification(KEYPOINTS, refinement="nmi", radar=BOTH, free=replace(ANYWHERE, scale=1.0))
OPTICAL = Specification(GUIDED_CHIPS, radar=NEITHER, free=ANYWHERE)
