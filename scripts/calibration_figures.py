"""The figure on calibration, from stored runs of the calibration suite."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scripts.drawing import BLUE, GREEN, GREY, ORANGE, FloatArray, Scenes, canvas

# For each run: its class, and the shares of places within CE50, CE90 and CE95.
RUNS = Path(__file__).resolve().parents[1] / "docs" / "figures" / "calibration.json"

_SAID = (0.5, 0.9, 0.95)
_FEWEST_RUNS = 5
_STYLES = {
    "rural": (BLUE, "o"),
    "suburban": (BLUE, "s"),
    "SAR–SAR, rural": (ORANGE, "o"),
    "SAR–SAR, suburban": (ORANGE, "s"),
    "optical, rural": (GREEN, "o"),
    "optical, suburban": (GREEN, "s"),
    "city, 1 m": (BLUE, "^"),
    "city, 2 m": (BLUE, "v"),
    "real sar-optical": ("black", "D"),
    "real optical-optical": (GREY, "D"),
}


def calibration(_: Scenes) -> Figure:
    """Stated probabilities against observed shares, by class."""
    classes = observed(RUNS)
    figure, (axes,) = canvas(5.6, 4.6, 1)
    axes.axis("on")
    axes.plot((0, 1), (0, 1), color=GREY, lw=1, zorder=0)
    shown = [name for name in _STYLES if len(classes.get(name, ())) >= _FEWEST_RUNS]
    for number, name in enumerate(shown):
        colour, marker = _STYLES[name]
        # Offset horizontally, so that no class hides another.
        said = np.array(_SAID) + 0.006 * (number - (len(shown) - 1) / 2)
        shares = classes[name]
        label = f"{name} ({len(shares)})"
        axes.plot(said, shares.mean(axis=0), marker, color=colour, ms=6, mfc="none", label=label)
    every = np.concatenate([runs for name, runs in classes.items() if not name.startswith("real")])
    axes.plot(
        _SAID, every.mean(axis=0), "-", color="black", lw=1.5, label=f"all simulated ({len(every)})"
    )
    axes.set(xlim=(0.4, 1), ylim=(0, 1.02), xlabel="stated probability", ylabel="share of places")
    axes.set_xticks(_SAID)
    axes.legend(fontsize=8, loc="lower right", frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def observed(path: Path) -> dict[str, FloatArray]:
    """Return the shares within the radii for each class, shape (runs, 3)."""
    classes = defaultdict(list)
    for run in json.loads(path.read_text(encoding="utf-8")):
        classes[run["group"]].append(run["within"])
    return {name: np.array(shares) for name, shares in classes.items()}
