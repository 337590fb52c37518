"""Judge the RPCs of an image at independent check points, before and after a refinement."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from ..assessment.sensor_accuracy import SensorErrors, draw_vectors, table_lines, write_table
from ..declaration import Output, file_lines, given_files, tool
from ..errors import TooFewPointsError
from ..geometry.tie_points import NONE_HELD_OUT
from ..kinds import FileIn, FileOut
from ..progress import SILENT, Progress
from ..raster_names import GEOTIFF
from ..rasters.atomic import Outputs
from ..registration.sensor_input import Ground, open_oriented_image, open_sensor_image
from ..sensor.control_points import READ_SUFFIXES, left_out, read_control_points
from ..sensor.rpc import RPC
from ..sensor.rpc_files import READ_SUFFIXES as RPC_SUFFIXES
from ..sensor.rpc_files import read_rpc
from .parameters import general, sensor

BEFORE, AFTER = "before", "after"


@dataclass(frozen=True)
class SensorAssessment:
    """Errors at check points, by the RPCs as delivered and, if given, as refined.

    Parameters
    ----------
    errors
        By "before" and "after".
    points
        Number of points.
    files
        What was written, by name.
    without_height
        Number of points that are left out, as the height of the ground is not known there.
    """

    errors: dict[str, SensorErrors]
    points: int
    files: dict[str, str]
    without_height: int = 0

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        measured = {name: errors.summary() for name, errors in self.errors.items()}
        return {
            "points": self.points,
            "points_without_height": self.without_height,
            AFTER: None,
            **measured,
            "files": self.files,
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        lost = [left_out(self.without_height)] if self.without_height else []
        return [*table_lines(self.errors), *lost, *file_lines(self.files)]


@tool(
    title="Assess RPCs",
    group="Quality",
    outputs=(
        Output("POINTS", "Number of check points", "points"),
        Output("BEFORE_RMSE_M", "Error before (m)", "before.rmse_m"),
        Output("BEFORE_CE90_M", "CE90 before (m)", "before.ce90_m"),
    ),
)
def assess_sensor(
    image: sensor.SensorImage,
    check_points: Annotated[
        Path,
        FileIn(
            help="Points that are independent of the refinement. If some have the role check, "
            "these alone count.",
            suffixes=READ_SUFFIXES,
        ),
    ],
    refined: Annotated[
        Path | None,
        FileIn(
            label="Refined RPCs",
            help="RPCs of refine_rpc: _RPC.TXT, .RPB, or an image (.tif) that has them.",
            suffixes=(*RPC_SUFFIXES, *GEOTIFF),
        ),
    ] = None,
    dem: sensor.Dem = None,
    dem_datum: sensor.DemDatum = None,
    table: Annotated[
        Path | None,
        FileOut(help="The errors of each point.", suffixes=(".csv",)),
    ] = None,
    picture: Annotated[
        Path | None,
        general.picture("The errors as arrows in the image."),
    ] = None,
    height: sensor.Height = None,
    geoid: sensor.Geoid = None,
    rpc: sensor.RpcFile = None,
    progress: Progress = SILENT,
) -> SensorAssessment:
    """Judge the RPCs of an image at independent check points, before and after a refinement.

    Errors on the ground are measured at the points' own heights; points without heights take them
    from the terrain model. All used points count, however large their errors.
    """
    ground = Ground(dem, dem_datum, geoid, height)
    with ExitStack() as stack:
        oriented = open_oriented_image(image, rpc, ground, None, stack, progress)
        points = read_control_points(
            check_points, oriented.orientation, oriented.source.grid, oriented.source.path
        )
        lost = points.without_height
        if not points.used.any():
            why = f": {left_out(int(lost.sum()))}" if lost.any() else ""
            raise TooFewPointsError(f"{check_points} holds no points that are used{why}")
        if points.has_roles:
            lost &= points.is_check
        points = points.take(points.independent)
        if len(points) == 0:
            raise TooFewPointsError(f"{check_points}: {NONE_HELD_OUT}")
        errors = {BEFORE: SensorErrors.of(oriented.orientation.rpc, points)}
        if refined is not None:
            errors[AFTER] = SensorErrors.of(_refined(refined, stack), points)
        with Outputs() as outputs:
            if table is not None:
                write_table(outputs.stage(table), points, errors)
            if picture is not None:
                draw_vectors(outputs.stage(picture), points, errors, oriented.source.grid.size)
    files = given_files({"table": table, "picture": picture})
    return SensorAssessment(errors, len(points), files, int(lost.sum()))


def _refined(path: Path, stack: ExitStack) -> RPC:
    if path.suffix.lower() in GEOTIFF:
        return open_sensor_image(path, None, stack)[1]
    return read_rpc(path)
