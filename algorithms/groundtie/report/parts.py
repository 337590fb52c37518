"""What confirms a transform all over a scene, and parts that it misplaces: in words, as a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..matching.parts import FEWEST_CHIPS, Part, largest_group, place_in_words
from ..matching.survey import Survey
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


def counts(survey: Survey) -> dict[str, int]:
    """Return the numbers of chips, of those that confirm, and of those that hardly match."""
    return {
        "chips": len(survey.centres),
        "confirming": survey.confirming,
        "hardly_matching": int(survey.is_unsupporting_chip.sum()),
    }


def coverage(survey: Survey) -> str:
    """Return in words how much of a scene confirms the transform, and where most does not."""
    count = counts(survey)
    line = (
        f"{count['confirming']} of {count['chips']} chips confirm the transform, "
        f"{count['hardly_matching']} hardly match"
    )
    group = largest_group(survey.centres, survey.is_unsupporting_chip)
    if len(group) < FEWEST_CHIPS:
        return line
    where = place_in_words(survey.grid, survey.centres[group].mean(axis=0))
    return f"{line}, {len(group)} of them side by side around the {where}"


def coverage_numbers(survey: Survey | None) -> dict[str, Any]:
    """Return `counts` as an entry of a result's summary; none without a survey."""
    return {} if survey is None else {"survey": counts(survey)}


def coverage_lines(survey: Survey | None) -> list[str]:
    """Return `coverage` as the line of a result; none without a survey."""
    return [] if survey is None else [f"all over the overlap: {coverage(survey)}"]


def shown(survey: Survey) -> dict[str, Any]:
    """Return the template's values for the chips and the parts, if there are any."""
    parts = survey.parts
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(parts))]
    return {
        "map": figures.svg_uri(parts_map(survey)),
        "rows": list(zip(colours, lines(survey), parts, strict=True)),
        "coverage": coverage(survey),
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
    axes.plot(*px[confirming].T, "o", color=figures.FIT_COLOUR, ms=6)
    hardly = other & survey.is_unsupporting_chip
    axes.plot(*px[hardly].T, "o", color=figures.REJECTED_COLOUR, mfc="none", ms=7, mew=2)
    axes.plot(*px[other & ~hardly].T, "x", color=figures.REJECTED_COLOUR, ms=7, mew=2)
    if not parts:
        return axes.figure
    farthest_px = max(part.distance_px for part in parts)
    # Chips of a part share its shift; the match of a single one may be farther than it reaches.
    shifts_px = survey.shifts_px.copy()
    for part in parts:
        shifts_px[list(part.members)] = part.shift_px
    arrows = figures.scaled_arrows(shifts_px, farthest_px, 0.1, grid)
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
