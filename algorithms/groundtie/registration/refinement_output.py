"""The files of a refinement: RPCs or an image that is made with them, residuals, report."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..assessment.comparison import Comparison
from ..declaration import given_files
from ..errors import OutputError, SameFileError
from ..progress import Progress
from ..raster_names import (
    GEOTIFF,
    file_name,
    is_only_raster_of_its_name,
    is_rpc_file_of,
    rpc_files,
)
from ..rasters.atomic import Outputs
from ..rasters.delivery import write_with_geotransform
from ..rasters.grid import FloatArray
from ..rasters.reading import RasterSource
from ..report.refinement_report import RefinementReport
from ..sensor.bias import Bias
from ..sensor.control_points import ControlPoints
from ..sensor.orientation import sensor_grid
from ..sensor.rpc_files import write_rpc
from ..sensor.rpc_fit import RPCFit
from ..sensor.rpc_tags import rpc_to_tags
from .ground_control import GroundControl
from .refinement import RefinedRpc
from .sensor_input import OrientedImage

# Writes the output of a refinement: refined RPCs, or an image that is made with them.
WriteOutput = Callable[[OrientedImage, RPCFit, Path, Progress], None]


def write_rpcs(image: OrientedImage, fit: RPCFit, path: Path, progress: Progress) -> None:
    """Write refined RPCs by themselves, or a copy of the image with them, by the suffix of `path`.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    source = image.source
    if path.suffix.lower() in GEOTIFF:
        tags = rpc_to_tags(fit.rpc)
        write_with_geotransform(source, source.grid, path, rpc_tags=tags, progress=progress)
        return
    write_rpc(path, fit.rpc)


@dataclass(frozen=True)
class RefinementFiles:
    """The files that are asked for; None: not asked for.

    Parameters
    ----------
    parameters
        The parameters that the tool was called with, for the report.
    write_output
        Writes the output.
    started
        When the work began, by `time.perf_counter`.
    """

    output: Path
    residuals: Path | None
    report: Path | None
    parameters: Mapping[str, Any]
    write_output: WriteOutput = write_rpcs
    started: float = field(default_factory=time.perf_counter)

    def written(self) -> dict[str, str]:
        """Return the files that are written, by name."""
        return given_files(
            {"output": self.output, "residuals": self.residuals, "report": self.report}
        )

    def points_or_report(self, found: GroundControl) -> ControlPoints:
        """Return matched points; if they are refused, write the report on that and raise.

        Raises
        ------
        NotRegisteredError
            They are refused.
        """
        if not found.registration.verdict.accepted and self.report is not None:
            replace(found.registration, parameters=self.parameters).report(self.report)
        return found.accepted_points()

    def write(
        self,
        refined: RefinedRpc,
        image: OrientedImage,
        found: GroundControl | None,
        progress: Progress,
    ) -> None:
        """Write all files; of a refused refinement the report alone.

        Parameters
        ----------
        refined
            The refined RPCs.
        image
            The image, with the RPCs as delivered.
        found
            The matching that the points come from; None: they were given.
        progress
            Receives every tile of an image that is written.

        Raises
        ------
        NotRegisteredError
            The refinement is refused.
        """
        with Outputs() as outputs:
            if refined.verdict.accepted:
                self.write_output(image, refined.fit, outputs.stage(self.output), progress)
                if self.residuals is not None:
                    by_refined = replace(image.orientation, rpc=refined.fit.rpc)
                    staged = outputs.stage(self.residuals)
                    refined.points.write(staged, by_refined, image.source.grid)
            # Last: once the report exists, so do all files that it describes.
            if self.report is not None:
                self._page(refined, image, found).write(outputs, self.report)
        refined.require_accepted()

    def _page(
        self, refined: RefinedRpc, image: OrientedImage, found: GroundControl | None
    ) -> RefinementReport:
        return RefinementReport(
            refined,
            None if found is None else _compared(refined.adjustment.bias, image, found),
            title=f"RPCs of {file_name(refined.path)}, refined",
            parameters=self.parameters,
            seconds=time.perf_counter() - self.started,
        )


def require_place(source: RasterSource, output: Path | None, *more: Path | None) -> None:
    """Refuse outputs that are files of the image, and RPCs where GDAL would not read them.

    Parameters
    ----------
    source
        The image.
    output
        Where its RPCs, or a copy with them, are to be written; None: nowhere.
    more
        Further outputs; None: not asked for.

    Raises
    ------
    SameFileError
        An output is a file that GDAL reads for the image.
    OutputError
        GDAL would take other RPCs.
    """
    read = {Path(name).resolve() for name in source.files()}
    for path in (output, *more):
        if path is not None and path.resolve() in read:
            raise SameFileError(f"{path} is read for {source.path}: give the output another name")
    if output is None:
        return
    is_copy = output.suffix.lower() in GEOTIFF
    raster = output if is_copy else Path(source.path)
    is_beside = not is_copy and is_rpc_file_of(output, raster)
    # Other drivers prefer RPCs of the raster itself or its .aux.xml to some or all RPC files.
    if is_beside and source.driver() != "GTiff":
        raise OutputError(
            f"GDAL may not take RPCs from {output.name}, as {raster} is no GeoTIFF: give the "
            "output another name, to be named as its RPC file (--rpc), or write a copy (.tif)"
        )
    found = rpc_files(raster, None if is_copy else output)
    # RPC files beside a copy are removed if it is the only raster of its name.
    is_kept = is_copy and not is_only_raster_of_its_name(output)
    if found and (is_kept or (is_beside and found[0].name != output.name)):
        raise OutputError(
            f"GDAL takes the RPCs of {raster} from {found[0].name}, and would not take those of "
            f"{output}: move {found[0].name} elsewhere, or give the output another name"
        )


def _compared(bias: Bias, image: OrientedImage, found: GroundControl) -> Comparison:
    """Draw the reference and the image on the map, as delivered and as refined."""
    delivered = replace(image.source, grid=sensor_grid(image.source, image.orientation))
    pair = found.registration.pair
    pair = replace(pair, input=replace(pair.input, source=delivered))

    def refined(xy: FloatArray) -> FloatArray:
        px = image.orientation.to_px(xy)
        return px + bias(px)

    return Comparison.of(pair, refined)
