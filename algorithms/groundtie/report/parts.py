"""The parts of a scene that its transform misplaces, in words and as a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..matching.survey import Part, Survey
from . import figures
from .correction import move_in_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours distinguishable with any colour vision, other than those of points [Okabe2008].
COLOURS = ("#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def summary(survey: Survey) -> list[dict[str, Any]]:
    """Return the parts that a survey found as JSON values."""
    return [
        {
            "where": part.where,
            "distance_px": part.distance_px,
            "shift_px": part.shift_px,
            "chips": part.chips,
            "confirming": confirming(survey, part),
            "excess": part.excess,
        }
        for part in survey.parts
    ]


def lines(survey: Survey) -> list[str]:
    """Return each part in words: its place, and its offset."""
    return [_in_words(part, survey) for part in survey.parts]


def shown(survey: Survey) -> dict[str, Any] | None:
    """Return the template's values for the parts; None: there are none."""
    parts = survey.parts
    if not parts:
        return None
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(parts))]
    return {
        "map": figures.svg_uri(parts_map(survey)),
        "rows": list(zip(colours, lines(survey), parts, strict=True)),
        "chips": len(survey.centres),
        "confirming": survey.confirming,
    }


def parts_map(survey: Survey) -> Figure:
    """Draw the matched chips, each part in its colour; the figure's edges are the grid's."""
    grid, parts = survey.grid, survey.parts
    axes = figures.map_axes(grid)
    confirming = survey.is_confirming_chip
    other = ~confirming
    for part in parts:
        other[list(part.members)] = False
    px = survey.centres.astype(float)
    farthest_px = max(part.distance_px for part in parts)
    # Chips of a part share its shift; the match of a single one may be farther than it reaches.
    shifts_px = survey.shifts_px.copy()
    for part in parts:
        shifts_px[list(part.members)] = part.shift_px
    arrows = figures.scaled_arrows(shifts_px, farthest_px, 0.1, grid)
    axes.plot(*px[confirming].T, "o", color=figures.FIT_COLOUR, ms=6)
    axes.plot(*px[other].T, "x", color=figures.REJECTED_COLOUR, ms=6)
    for k, part in enumerate(parts):
        members, colour = np.array(part.members, int), COLOURS[k % len(COLOURS)]
        axes.plot(*px[members].T, "o", color=colour, ms=8)
        figures.draw_arrows(axes, px[members], arrows.vector_px[members], colour)
    figures.draw_scale(axes, arrows, grid, px)
    return axes.figure


def confirming(survey: Survey, part: Part) -> int:
    """Return the number of a part's chips that match where the transform places them."""
    return int(survey.is_confirming_chip[list(part.members)].sum())


def _in_words(part: Part, survey: Survey) -> str:
    """Return a part as "upper left: 9 chips lie 10.3 px off (10.0 m east, …)"."""
    origin, end = survey.grid.pixel_to_map(np.array([(0.0, 0.0), part.shift_px]))
    direction = move_in_words(end - origin, survey.grid)
    return (
        f"{part.where}: {part.chips} chips lie {part.distance_px:.1f} px off"
        f"{f' ({direction})' if direction else ''}; {confirming(survey, part)} of them "
        "confirm the transform"
    )
