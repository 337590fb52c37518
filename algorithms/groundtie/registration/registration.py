"""A registration: the judged result of the pipeline, and what can be done with it."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Raster
from ..call_paths import check_paths
from ..context import MOST_WORKERS, threads
from ..declaration import file_lines, given_files
from ..errors import NotRegisteredError, ParameterError
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..kinds import Choice, FileOut, Number, RasterIn, RasterOut, WrittenKind
from ..masks.used import MaskUsed
from ..matching.check import Check
from ..matching.survey import Survey
from ..raster_names import GEOTIFF, file_name, is_gdal_name
from ..rasters.atomic import Outputs
from ..rasters.delivery import warp_to_array
from ..rasters.pair import ImagePair
from ..rasters.reading import RasterSource, open_raster
from ..rasters.vrt import SUFFIX as VRT
from ..rasters.warping import METHODS
from ..report.correction import Correction
from ..report.details import extremes
from ..report.parts import coverage_lines
from ..report.report import Report
from ..similarity.surface import Surface
from .evidence import RegistrationEvidence
from .registered_output import (
    OUTPUT_GRIDS,
    UNTOUCHED,
    BeyondOverlap,
    RegisteredOutput,
    grid_of_output,
    resampled_onto,
)
from .scene import SceneInfo
from .specification import Specification
from .stored_transform import transform_of
from .verdict import Verdict

_LOG = logging.getLogger(__name__)

# How many surfaces of the best and of the worst check points a report shows.
_EXTREMES = 3

# Arguments given outside of a tool's call, which are checked as its parameters are.
_READ = RasterIn(help="A raster that is read.")
_WARPED = RasterOut(help="The registered raster.", suffixes=(*GEOTIFF, VRT))
_REPORT = FileOut(help="An HTML page.", suffixes=(".html",), numbers=True)
_GRID = Choice(help="The grid of the registered raster.", choices=OUTPUT_GRIDS)
_RESAMPLING = Choice(help="How pixels are interpolated.", choices=METHODS)
_WORKERS = Number(help="Number of threads.", integer=True, minimum=1, maximum=MOST_WORKERS)


def _working_folder() -> Path:
    """Return the working folder; where it was removed, relative paths name nothing."""
    with suppress(OSError):
        return Path.cwd()
    return Path()


@dataclass(frozen=True, repr=False)
class Registration:
    """A judged registration.

    Its rasters stay open until it is closed, its `with` block ends, or it is garbage-collected.

    Parameters
    ----------
    pair
        The images with all masks.
    spec
        How they were registered.
    scene
        Facts about the images.
    mask
        Which mask was used.
    verdict
        Whether the registration can be trusted.
    check
        The check points, with their surfaces; None without a transform.
    evidence
        The basis of the verdict; None without a transform.
    parameters
        The parameters that the tool was called with.
    folder
        The working folder then, at which their relative paths begin.
    started
        When the work began, by `time.perf_counter`.
    files
        The files that were written, by name.
    tried
        The ways that the tool `register` tried, a line each.
    beyond
        The part of the written image outside of the overlap; None: there is none.
    rasters
        Closes the images and masks.
    """

    pair: ImagePair
    spec: Specification
    scene: SceneInfo
    mask: MaskUsed
    verdict: Verdict
    check: Check | None = None
    evidence: RegistrationEvidence | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    folder: Path = field(default_factory=_working_folder)
    started: float = 0.0
    files: Mapping[str, Path] = field(default_factory=dict)
    tried: tuple[str, ...] = ()
    beyond: BeyondOverlap | None = None
    rasters: ExitStack = field(default_factory=ExitStack, repr=False, compare=False)

    @property
    def transform(self) -> Transform | None:
        """Reference map position ↔ input pixel position, whatever the verdict on it."""
        return None if self.evidence is None else self.evidence.estimate.transform

    @property
    def correction(self) -> Correction | None:
        """How far the transform moves the input."""
        return None if self.transform is None else Correction.of(self.transform, self.pair.grid)

    @property
    def tie_points(self) -> TiePoints | None:
        """All tie points, those of the fit first."""
        if self.evidence is None:
            return None
        return TiePoints.concatenate([self.evidence.estimate.points, self.evidence.check])

    @property
    def survey(self) -> Survey | None:
        """The survey by chips all over the overlap; None: there was none."""
        return None if self.evidence is None else self.evidence.surveys.whole

    def notes(self) -> list[str]:
        """Return notes for the user on how the images were read and matched."""
        return [
            *self.pair.notes(),
            *(() if self.evidence is None else self.evidence.estimate.notes),
        ]

    def accepted_transform(self) -> Transform:
        """Return the transform of an accepted registration."""
        assert self.verdict.accepted and self.transform is not None
        return self.transform

    def require_accepted(self, done: str = "registered to") -> None:
        """Raise `NotRegisteredError` if it was refused; `done` names what was not done."""
        if not self.verdict.accepted:
            input, reference = (
                image.source.path for image in (self.pair.input, self.pair.reference)
            )
            raise NotRegisteredError(
                f"{input} was not {done} {reference}: {self.verdict.sentence()}",
                self.verdict,
                self.tried,
            )

    def warp(
        self,
        raster: Any = None,
        output: Path | str | None = None,
        grid: str = "reference",
        resampling: str = "cubic",
        workers: int | None = None,
    ) -> Raster | None:
        """Resample a raster by the transform, once.

        If a part of it lies beyond the overlap, a warning is logged (see `beyond_overlap`).

        Parameters
        ----------
        raster
            A raster as `open_raster` takes it: another band, date or resolution of the input, with
            the input's nominal geotransform; None: the input.
        output
            The GeoTIFF to write; None: the registered raster is returned.
        grid
            One of `registered_output.OUTPUT_GRIDS`; "untouched" needs an output.
        resampling
            One of `warping.METHODS`.
        workers
            Number of threads; None: one per processor.

        Raises
        ------
        GeoreferencingError, NoOverlapError
            The raster lies elsewhere than the input.
        ParameterError
            There is no such grid, resampling or number of threads; the output does not name a
            raster that can be written; or the grid is "untouched" without an output.
        SameFileError
            The output is the raster, or was read by the registration.
        OutputError
            The output cannot be written.
        """
        path = None if output is None else _WARPED.check("output", output)
        grid, resampling = _GRID.check("grid", grid), _RESAMPLING.check("resampling", resampling)
        threads_used = None if workers is None else int(_WORKERS.check("workers", workers))
        if path is None and grid == UNTOUCHED:
            raise ParameterError(f"the grid {UNTOUCHED} needs an output")
        transform = self.accepted_transform()
        reference = self.pair.reference.source.grid
        with threads(threads_used) as context, ExitStack() as stack:
            source = self.pair.input.source
            if raster is not None:
                source = stack.enter_context(open_raster(raster))
                transform = transform_of(transform, source, "the registration")
            if path is not None:
                self._check_written("output", _WARPED, path, source)
            beyond = self.beyond_overlap(grid_of_output(path, grid), transform)
            if beyond is not None:
                _LOG.warning(beyond.line())
            if path is not None:
                with Outputs() as outputs:
                    made = RegisteredOutput(path, grid, resampling)
                    made.write(source, reference, transform, outputs, context)
                return None
            to_px, target = resampled_onto(grid, reference, transform)
            return warp_to_array(source, to_px, target, resampling, workers=context.workers)

    def beyond_overlap(self, grid: str, transform: Transform | None = None) -> BeyondOverlap | None:
        """Return the part of a registered raster where nothing has checked the transform.

        None: there is no such part, as on the reference's grid.

        Parameters
        ----------
        grid
            One of `registered_output.OUTPUT_GRIDS`.
        transform
            The raster's transform; None: the input's.

        Raises
        ------
        ParameterError
            There is no such grid.
        """
        grid = _GRID.check("grid", grid)
        assert self.evidence is not None
        return BeyondOverlap.of(
            grid, transform or self.accepted_transform(), self.evidence.grid.covers
        )

    def report(self, path: Path | str) -> None:
        """Write the report, an HTML page, and its numbers beside it as JSON.

        Raises
        ------
        ParameterError
            The path does not end in `.html`.
        OutputError
            A file cannot be written.
        """
        html = _REPORT.check("report", path)
        self._check_written("report", _REPORT, html)
        with Outputs() as outputs:
            self.page().write(outputs, html)

    def _check_written(
        self, name: str, kind: WrittenKind, path: Path, warped: RasterSource | None = None
    ) -> None:
        """Raise `SameFileError` or `OutputError` if a file would overwrite one that is read.

        These are the warped raster, the images, and all other inputs among the parameters.
        """
        read: dict[str, Any] = {
            parameter: self.folder / value if isinstance(value, Path) else value
            for parameter, value in self.parameters.items()
            if (isinstance(value, Path) or (isinstance(value, str) and is_gdal_name(value)))
            and value not in self.files.values()
        }
        read |= {"reference": self.pair.reference.source, "input": self.pair.input.source}
        read |= {} if warped is None else {"raster": warped}
        check_paths([*((other, _READ, value) for other, value in read.items()), (name, kind, path)])

    def page(self) -> Report:
        """Return the report."""
        names = [file_name(image.source.path) for image in (self.pair.input, self.pair.reference)]
        done = "registered to" if self.verdict.accepted else "not registered to"
        return Report(
            self,
            title=f"{names[0]} {done} {names[1]}",
            parameters=self.parameters,
            seconds=time.perf_counter() - self.started,
        )

    def extreme_surfaces(self) -> tuple[tuple[str, Surface], ...]:
        """Return the similarity surfaces of the check points with the best and worst residuals."""
        if self.check is None or self.transform is None:
            return ()
        used = np.flatnonzero(self.check.points.used)
        residuals = self.check.points.take(used).residual_px(self.transform)
        found = extremes(np.hypot(*residuals.T), _EXTREMES)
        return tuple((label, self.check.surfaces[used[k]]) for label, k in found)

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {**self.page().summary(), "files": given_files(self.files)}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        v, transform, correction = self.verdict, self.transform, self.correction
        lines = [*self.tried, f"{v.word}: {v.sentence()}"]
        if correction is not None:
            lines.insert(0, f"correction: {correction.text()}")
        if v.accepted and transform is not None:
            lines += [
                v.model_line(transform.model.kind),
                v.error_line(),
                v.accuracy_line(),
                f"check points that agree: {v.check_points_agreeing} of {v.check_points}; by "
                f"chance 1 in 10^{-v.log10_chance:.0f}",
                *coverage_lines(self.survey),
            ]
            lines += self.notes()
            if self.mask.image is not None:
                lines.append(self.mask.line())
            if self.beyond is not None:
                lines.append(self.beyond.line())
        return lines + file_lines(self.files)

    def __repr__(self) -> str:
        # The default would show all fields, which hold arrays and open rasters.
        return f"<{type(self).__name__} {self.verdict.word}: {self.verdict.reason}>"

    def close(self) -> None:
        """Close the rasters; results stay available."""
        self.rasters.close()

    def __enter__(self) -> Registration:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
