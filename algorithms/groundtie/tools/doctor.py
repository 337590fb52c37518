"""State what is installed, what is missing, and what cannot run therefore."""

from __future__ import annotations

from ..declaration import Output, tool
from ..installation import Installation, examine
from ..progress import SILENT, Progress


@tool(
    title="What is installed",
    group="Information",
    outputs=(Output("MISSING", "Number of things that are missing", "missing_count"),),
)
def doctor(progress: Progress = SILENT) -> Installation:
    """State what is installed, what is missing, and what cannot run therefore.

    Python packages are imported and their versions compared with those that are needed; GDAL's
    formats, PROJ's data and the grids of the geoids EGM96 and EGM2008 are tried. If something
    is marked as not here, only what its line names cannot run. If something is marked as missing,
    the exit code is 2. Put these lines into a report of a bug.
    """
    progress.update(0.0, "importing packages")
    return examine()
