"""Check points: chips in held-out blocks, matched by their own evidence alone."""

from __future__ import annotations

from dataclasses import dataclass

from ..context import Context
from ..geometry.models import Model
from ..geometry.tie_points import TiePoints
from .belief_propagation import Surfaces
from .layout import ChipLayout
from .matcher import Places
from .surface_fit import SurfaceMatcher, check_points

# Largest shift of a check chip from its position predicted by the model.
CHECK_RADIUS_PX = 12


@dataclass(frozen=True)
class Check:
    """The matches of check chips.

    Parameters
    ----------
    points
        The check points, in the order of the surfaces.
    surfaces
        Their similarity surfaces, shape (n, 2 r + 1, 2 r + 1).
    """

    points: TiePoints
    surfaces: Surfaces


def check_model(
    matcher: SurfaceMatcher, layout: ChipLayout, model: Model, context: Context
) -> Check:
    """Match the check chips around their positions predicted by a model on the map.

    Parameters
    ----------
    matcher
        Matches the chips.
    layout
        Layout of the check chips, inside the held-out blocks.
    model
        The model that is checked.
    context
        Threads and progress.

    Raises
    ------
    TooFewPointsError
        A mask leaves too few pixels to match.
    """
    places = Places(matcher.pair.grid, layout.check_centres, layout.check_chip_px)
    matched = matcher.seeing_all().match(model, places, CHECK_RADIUS_PX, context)
    surfaces = matcher.for_check(matched, layout)
    points = check_points(matcher.pair, surfaces, model)
    return Check(points.take(points.located), surfaces.combined[points.located])
