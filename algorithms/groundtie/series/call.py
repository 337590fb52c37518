"""From the call of a tool to a registered series."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..context import Context, threads
from ..errors import CancelledError, ParameterError, SameFileError
from ..executors import open_executor
from ..geometry.transform import Transform
from ..progress import Progress
from ..raster_names import identity
from ..rasters.atomic import LONGEST_NAME
from ..registration.evidence import DateEvidence
from ..registration.registered_output import model_for_grid
from ..registration.user_masks import UserMask
from ..vrt_sources import sources_of
from .dates import Date, footprint_shares, open_dates
from .delivery import SeriesFiles, registered_name
from .frame import SeriesFrame
from .inputs import Listed, list_dates
from .pairs import Settings
from .registering import Matching
from .series import Series, SeriesDate
from .settling import DateVerdict, settle
from .stored import UNFINISHED, StoredSeries, keep_unfinished, read_series


@dataclass(frozen=True)
class SeriesCall:
    """The call of a series registration: inputs, settings and outputs.

    Parameters
    ----------
    listed
        All dates, the reference among them.
    reference
        The reference's name; None: there is no reference.
    settings
        How each pair is registered.
    files
        The files to write.
    parameters
        All parameters of the tool.
    """

    listed: tuple[Listed, ...]
    reference: str | None
    settings: Settings
    files: SeriesFiles
    parameters: Mapping[str, Any]

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> SeriesCall:
        """Return a call by the values of the tool's parameters.

        Raises
        ------
        ParameterError, SameFileError
            The values contradict each other, or name a file that does not exist.
        """
        listed, reference = _listed(given)
        _require_names_that_fit(listed, reference)
        files = SeriesFiles(
            given["output_folder"], given["output_grid"], given["resampling"], given["report"]
        )
        _require_apart(listed, files.folder)
        settings = Settings(
            model_for_grid(given["model"], given["output_grid"]),
            given["max_error"],
            given["search_radius"],
            given["matching_pixel_size"],
            band=given["band"],
        )
        return cls(listed, reference, settings, files, given)

    def run(self, progress: Progress, executor: Executor | None = None) -> Series:
        """Register the series, and write its files.

        Parameters
        ----------
        progress
            Receives every step.
        executor
            Runs registrations instead of threads and the scheduler; it stays open.

        Raises
        ------
        NotRegisteredError
            No date was registered; the report is written.
        """
        started = time.perf_counter()
        stored = read_series(self.files.folder)
        given = self.parameters
        with threads(given["workers"], progress) as context, ExitStack() as stack:
            if executor is None and given["scheduler"] is not None:
                executor = stack.enter_context(open_executor(1, given["scheduler"]))
            opened = open_dates(self.listed, self.settings.band, stack, context.part(0.0, 0.05))
            dates, failures = _on_one_map(*opened, self.reference)
            try:
                series = self._registered(
                    dates, failures, stored, context.part(0.05, 0.8), executor
                )
                series = replace(series, seconds=time.perf_counter() - started)
                return self.files.write(series, stored, context.part(0.8, 1.0))
            except CancelledError as error:
                if (self.files.folder / UNFINISHED).exists():
                    raise CancelledError(
                        "cancelled; the next run in this folder goes on with what was registered"
                    ) from error
                raise

    def _registered(
        self,
        dates: Sequence[Date],
        failures: Mapping[str, str],
        stored: StoredSeries,
        context: Context,
        executor: Executor | None,
    ) -> Series:
        hub = next((k for k, date in enumerate(dates) if date.name == self.reference), None)
        home = dates[hub or 0]
        key = None if hub is None else home.key
        frame = stored.frames.get(key)  # stored registrations refer to it
        if frame is None or not frame.is_of(home.source.grid):
            frame = SeriesFrame.around(home.source.grid, [date.source.grid for date in dates])
        footprints = [date.footprint(frame.grid) for date in dates]
        matching = Matching(
            dates,
            footprint_shares(footprints),
            frame,
            self.settings,
            stored.pairs,
            context,
            executor,
            partial(keep_unfinished, self.files.folder, key, frame),
        )
        if hub is None:
            hub, datum = matching.freely(), "to each other (mean displacement zero)"
        else:
            matching.from_hub(hub)
            datum = f"to {home.name}"
        is_free = self.reference is None
        settled = settle(frame, matching.results, len(dates), hub, is_free=is_free)
        found = {
            date.name: _judged(date, verdict, frame, date.name == self.reference)
            for date, verdict in zip(dates, settled.verdicts, strict=True)
        }
        for one in self.listed:
            if one.name in failures:
                unreadable = DateVerdict.of(DateEvidence(failures[one.name]))
                found[one.name] = SeriesDate(one, unreadable)
        return Series(
            tuple(found[one.name] for one in self.listed),
            frame,
            dates[hub].source.grid,
            datum,
            tuple(matching.results.values()),
            settled,
            tuple(date.name for date in dates),
            key,
            matching.done,
            matching.reused,
            self.parameters,
        )


def _listed(given: Mapping[str, Any]) -> tuple[tuple[Listed, ...], str | None]:
    """Return all dates in the order of their times, and the name of the reference."""
    dates, name = list_dates(given["inputs"], given["asset"]), None
    if given["reference"] is not None:
        (reference,) = list_dates([given["reference"]], None)
        # A reference that is a date of the series keeps its place and its name.
        same = next((k for k, date in enumerate(dates) if _is_same(date, reference)), 0)
        if _is_same(dates[same], reference):
            reference = dates[same]
        others = [date for date in dates if not _is_same(date, reference)]
        if any(date.name == reference.name for date in others):
            reference = replace(reference, name=f"{reference.name} (reference)")
        values, mask = given["reference_mask_values"], given["reference_mask"]
        if mask is not None or values is not None:
            reference = replace(reference, mask=UserMask.of(reference.raster, mask, values))
        dates, name = (*others[:same], reference, *others[same:]), reference.name
    elif given["reference_mask"] is not None or given["reference_mask_values"] is not None:
        raise ParameterError("a mask of the reference needs a reference")
    if len(dates) < 2:
        raise ParameterError("a series needs two dates at least, or one and a reference")
    return dates, name


def _is_same(date: Listed, other: Listed) -> bool:
    return identity(date.raster) == identity(other.raster)


def _require_names_that_fit(listed: tuple[Listed, ...], reference: str | None) -> None:
    """Raise an error for a date whose registered raster no file system could name."""
    for date in listed:
        size = len(os.fsencode(registered_name(date.name)))
        if date.name != reference and size > LONGEST_NAME:
            raise ParameterError(
                f"a date of the series has a name that is too long by {size - LONGEST_NAME} bytes "
                f"for its registered image: {date.name[:60]}…; give it another in a CSV table with "
                "the columns file and name"
            )


def _require_apart(listed: tuple[Listed, ...], folder: Path) -> None:
    """Raise an error if outputs would be written beside the inputs or their sources."""
    folder = folder.resolve()
    for date in listed:
        if not isinstance(date.raster, Path):
            continue
        files = date.raster.resolve(), *sources_of(date.raster)
        # A link counts where it lies, too: the next run would find the outputs beside it.
        if folder in (date.raster.parent.resolve(), *(path.parent for path in files)):
            raise SameFileError(f"the output folder holds an input: {date.raster}")


def _on_one_map(
    opened: Sequence[Date], failures: Mapping[str, str], reference: str | None
) -> tuple[list[Date], dict[str, str]]:
    """Return the dates with a CRS, or without, as the reference, and why others are left out.

    Raises
    ------
    ParameterError
        The reference cannot be opened, or fewer than two dates are left.
    """
    failures = dict(failures)
    if reference in failures:
        raise ParameterError(failures[reference])
    has_crs = {date.name: date.source.grid.crs is not None for date in opened}
    most = 2 * sum(has_crs.values()) >= len(has_crs)
    wanted = most if reference is None else has_crs[reference]
    dates = [date for date in opened if has_crs[date.name] == wanted]
    for date in opened:
        if has_crs[date.name] != wanted:
            failures[date.name] = f"{date.source.path} has {'no' if wanted else 'a'} CRS"
    if len(dates) < 2:
        raise ParameterError("; ".join(failures.values()))
    return dates, failures


def _judged(date: Date, verdict: DateVerdict, frame: SeriesFrame, is_reference: bool) -> SeriesDate:
    transform = None
    if verdict.displacement is not None:
        model = frame.model(verdict.displacement)
        transform = Transform(model, frame.grid.crs, date.source.grid)
    return SeriesDate(date.listed, verdict, date, transform, is_reference)
