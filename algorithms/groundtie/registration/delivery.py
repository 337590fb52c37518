"""The output of a registering tool: the registered image and its files, or a refusal's report."""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..context import Context, threads
from ..geometry.tie_point_files import write_tie_points
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs, write_json
from ..rasters.grid import Grid
from ..report.stac import quality_of, stac_item
from .asked import USUAL, asked_masks, specified
from .displacement import write_displacement
from .opening import OpenPair, open_pair, pair_images
from .pipeline import run
from .registered_output import BeyondOverlap, RegisteredOutput, grid_of_output
from .registration import Registration
from .specification import Specification


@dataclass(frozen=True)
class RegistrationFiles:
    """The files of a registration; None: not asked for."""

    output: RegisteredOutput | None = None
    tie_points: Path | None = None
    transform: Path | None = None
    report: Path | None = None
    displacement: Path | None = None

    def named(self) -> dict[str, Path]:
        """Return the files that `write` writes for an accepted registration, by name."""
        named = {
            "output": None if self.output is None else self.output.path,
            "tie_points": self.tie_points,
            "transform": self.transform,
            "displacement": self.displacement,
            "report": self.report,
        }
        return {name: path for name, path in named.items() if path is not None}

    def beyond(self, registration: Registration) -> BeyondOverlap | None:
        """Return the written image's part outside of the overlap; None: no such part, or image."""
        output = self.output
        if output is None or not registration.verdict.accepted:
            return None
        return registration.beyond_overlap(grid_of_output(output.path, output.grid))

    def write(self, registration: Registration, context: Context) -> None:
        """Write all files, or for a refused registration the report alone."""
        with Outputs() as outputs:
            grid = None
            if registration.verdict.accepted:
                grid = self._write_results(registration, outputs, context)
            # Last: once the report exists, so do all files that it describes.
            if self.report is not None:
                item = self._item(registration, grid, self.report)
                registration.page().write(outputs, self.report, item)

    def _item(
        self, registration: Registration, grid: Grid | None, report: Path
    ) -> Mapping[str, Any]:
        """Return the STAC item of a registered raster on a grid; empty without one."""
        if self.output is None or grid is None:
            return {}
        return stac_item(
            registration.pair.input.source,
            self.output.path,
            grid,
            report.parent,
            quality_of(registration.verdict, registration.accepted_transform()),
        )

    def _write_results(
        self, registration: Registration, outputs: Outputs, context: Context
    ) -> Grid | None:
        """Write an accepted registration's results, and return the registered raster's grid."""
        transform, points = registration.accepted_transform(), registration.tie_points
        evidence = registration.evidence
        assert points is not None and evidence is not None
        if self.tie_points is not None:
            write_tie_points(outputs.stage(self.tie_points), points, transform)
        if self.transform is not None:
            write_json(outputs.stage(self.transform), transform.to_json())
        reference = registration.pair.reference.source
        if self.displacement is not None:
            write_displacement(evidence, reference, outputs.stage(self.displacement))
        if self.output is None:
            return None
        context.update(0.0, "writing the registered image")
        source = registration.pair.input.source
        return self.output.write(source, reference.grid, transform, outputs, context)


@dataclass(frozen=True)
class Call:
    """How a registering tool was called, apart from its specification: the same for all tools.

    Parameters
    ----------
    reference, input
        Rasters as `open_raster` takes them.
    files
        The files to write.
    bands, masks
        See `opening.open_pair`.
    parameters
        All parameters of the tool, for the report.
    workers
        Number of threads; None: one per processor.
    progress
        Receives every step.
    """

    reference: Any
    input: Any
    files: RegistrationFiles
    bands: tuple[int | None, int | None] = (None, None)
    masks: tuple[Any, Any] = (None, None)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    workers: int | None = None
    progress: Progress = SILENT

    @classmethod
    def of(cls, parameters: Mapping[str, Any], progress: Progress) -> Call:
        """Return the call of a registering tool; see `register_as`."""
        given = {**USUAL, **parameters}
        output = None
        if given["output"] is not None:
            output = RegisteredOutput(given["output"], given["output_grid"])
        return cls(
            given["reference"],
            given["input"],
            RegistrationFiles(
                output,
                given["tie_points"],
                given["transform"],
                given["report"],
                given["displacement"],
            ),
            (given["reference_band"], given["input_band"]),
            asked_masks(given, "input"),
            parameters,
            given["workers"],
            progress,
        )

    def register(self, spec: Specification) -> Registration:
        """Register as specified, and write the files.

        Raises
        ------
        NotRegisteredError
            The registration was refused.
        """
        with threads(self.workers, self.progress) as context, ExitStack() as stack:
            context.update(0.0, "opening the images")
            opened = stack.enter_context(self.open(spec, context.part(0.0, 0.02)))
            found = run(opened, spec, context.part(0.02, 0.7))
            return self.deliver(found, context.part(0.7, 1.0), stack.pop_all())

    def open(
        self, spec: Specification, context: Context
    ) -> contextlib.AbstractContextManager[OpenPair]:
        """Open the images and masks."""
        return open_pair(self.reference, self.input, spec, context, self.bands, self.masks)

    def with_limits(self, opened: OpenPair, spec: Specification, context: Context) -> OpenPair:
        """Return an open pair with the search limits of another specification."""
        images = opened.images
        return pair_images(
            images.reference,
            images.input,
            spec,
            context.quiet(),
            self.masks,
            opened.stack,
            opened.started,
        )

    def deliver(
        self, registration: Registration, context: Context, stack: ExitStack
    ) -> Registration:
        """Write the registration's files; `stack` keeps its rasters open as long as it lives.

        Raises
        ------
        NotRegisteredError
            It was refused; its report is written.
        """
        with stack:
            beyond = self.files.beyond(registration)
            registration = replace(registration, parameters=self.parameters, beyond=beyond)
            self.files.write(registration, context)
            registration.require_accepted()
            rasters = stack.pop_all()
        kept = replace(registration, files=self.files.named(), rasters=rasters)
        weakref.finalize(kept, rasters.close)
        return kept


def register_as(
    preset: Specification, parameters: Mapping[str, Any], progress: Progress
) -> Registration:
    """Register as a tool does.

    Parameters
    ----------
    preset
        The specification that the tool starts from.
    parameters
        The values of its parameters by name: those of `tools.coregister`.
    progress
        Receives every step.

    Raises
    ------
    NotRegisteredError
        The registration was refused.
    """
    return Call.of(parameters, progress).register(specified(preset, parameters))
