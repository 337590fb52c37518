"""Draw the figures of the documentation from simulated scenes with fixed seeds."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure

if not __package__:
    # Run as a file: Python would look for modules beside it, but the scripts are a package.
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from scripts.calibration_figures import calibration
from scripts.drawing import Scenes, write
from scripts.feature_figures import features, hog, masks, surface_model
from scripts.search_figures import propagation, rotation, search, similarity
from scripts.series_figures import series
from scripts.verdict_figures import pipeline, rpc, survey, verdict

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"

DRAWN: Mapping[str, Callable[[Scenes], Figure]] = {
    "architecture": pipeline,
    "calibration": calibration,
    "method-similarity": similarity,
    "method-search": search,
    "method-belief-propagation": propagation,
    "method-features": features,
    "method-hog": hog,
    "method-masks": masks,
    "method-rotation": rotation,
    "method-rpc": rpc,
    "method-series": series,
    "method-surface-model": surface_model,
    "method-survey": survey,
    "method-verdict": verdict,
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figures", type=Path, default=FIGURES, help="folder of the figures")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(DRAWN)}; none: all")
    options = parser.parse_args()
    options.figures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        scenes = Scenes(Path(folder))
        for name in options.names or DRAWN:
            path = options.figures / f"{name}.png"
            write(DRAWN[name](scenes), path)
            print(f"{path}: {path.stat().st_size / 1000:.0f} kB", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
