"""The picture of the results of `detector_repeatability`, as [Suri2010] figures 6.9–6.14."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..rasters.atomic import write_figure
from .evaluation import Evaluation
from .repeatability import CLASS_NAMES

# Share of a class's width that the bars of all variants fill.
_WIDTH = 0.8


def draw_evaluations(path: Path, evaluations: Sequence[Evaluation]) -> None:
    """Draw repeatability and matches by class of overlap error as a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    at, width = np.arange(len(CLASS_NAMES)), _WIDTH / len(evaluations)
    for i, one in enumerate(evaluations):
        x = at + (i - (len(evaluations) - 1) / 2) * width
        colour = f"C{i}"
        left.bar(x[:-1], 100 * one.repeated[:-1], width, color=colour, label=one.variant)
        right.bar(x, one.matched.by_class, width, color=colour, alpha=0.35)
        right.bar(x, one.filtered.by_class, width, color=colour, label=one.variant)
    left.set(
        title="Repeatability",
        xlabel="overlap error",
        ylabel="% of the smaller number of features",
        xticks=at[:-1],
        xticklabels=CLASS_NAMES[:-1],
    )
    right.set(
        title="Matches; dark: after filtering",
        xlabel="overlap error",
        ylabel="matches",
        xticks=at,
        xticklabels=CLASS_NAMES,
    )
    left.legend()
    write_figure(path, figure, 120)
