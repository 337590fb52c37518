"""Writing the files of a registered series, or the report on a refused one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..context import Context
from ..errors import NoOverlapError, NotRegisteredError
from ..geometry.transform import Transform
from ..geometry.vector_layers import write_vector_layer
from ..rasters.atomic import Outputs, make_folder, write_csv, write_json, writing
from ..rasters.grid import Grid
from ..rasters.reading import open_raster
from ..registration.registered_output import UNTOUCHED_TOLERANCE_PX, RegisteredOutput
from ..registration.verdict import Verdict
from ..report.stac import stac_item
from ..runs import RUN, digest, has_written, run_tags
from ..version import __version__
from .series import TABLE_COLUMNS, Series, SeriesDate
from .stored import SERIES_JSON, StoredDate, StoredSeries, forget_unfinished, state_of

TABLE_CSV, TABLE_GPKG = "series.csv", "series.gpkg"


@dataclass(frozen=True)
class SeriesFiles:
    """The files of a series.

    Parameters
    ----------
    folder
        Folder of registered rasters, tables and `series.json`.
    output_grid, resampling
        See `RegisteredOutput`.
    report
        Path of the HTML page; None: no page.
    """

    folder: Path
    output_grid: str
    resampling: str
    report: Path | None

    def write(self, series: Series, stored: StoredSeries, context: Context) -> Series:
        """Write all files; of a series without registered dates, the report alone.

        Rasters that an earlier run wrote of dates that are no longer registered are removed.

        Raises
        ------
        NotRegisteredError
            No date was registered.
        """
        if not series.registered:
            if self.report is not None:
                make_folder(self.report.parent)
            with Outputs() as outputs:
                self._write_report(series, outputs)
            self._remove_stale(series, stored)
            self._remove_tables()
            forget_unfinished(self.folder)
            raise _refusal(series)
        make_folder(self.folder)
        with Outputs() as outputs:
            series = self._with_rasters(series, stored, outputs, context)
            write_csv(outputs.stage(self.folder / TABLE_CSV), TABLE_COLUMNS, series.rows())
            _write_layer(outputs.stage(self.folder / TABLE_GPKG), series)
            write_json(outputs.stage(self.folder / SERIES_JSON), series.to_json())
            # Last: once the report exists, so do the files that it describes.
            self._write_report(series, outputs)
        self._remove_stale(series, stored)
        forget_unfinished(self.folder)
        return series

    def raster_key(self, date: SeriesDate, series: Series) -> str:
        """Return a digest of all that a date's raster is made from, except the transform."""
        assert date.date is not None
        facts = date.date.facts, series.map_grid, self.output_grid, self.resampling
        return digest(facts, __version__)

    def _with_rasters(
        self, series: Series, stored: StoredSeries, outputs: Outputs, context: Context
    ) -> Series:
        """Write the rasters that do not exist yet, and return the series with all its rasters."""
        dates = []
        for number, one in enumerate(series.dates):
            part = context.part(number / len(series.dates), (number + 1) / len(series.dates))
            if one.is_registered:
                try:
                    one = self._with_raster(one, series, stored, outputs, part)
                except NoOverlapError as error:
                    # The date lies outside of the series' map; the other dates are kept.
                    reason = f"{one.verdict.reason}; no raster: {error}"
                    one = replace(one, verdict=replace(one.verdict, reason=reason))
            dates.append(one)
        files = {"output_folder": self.folder}
        if self.report is not None:
            files["report"] = self.report
        return replace(series, dates=tuple(dates), files=files)

    def _with_raster(
        self,
        one: SeriesDate,
        series: Series,
        stored: StoredSeries,
        outputs: Outputs,
        context: Context,
    ) -> SeriesDate:
        """Return a date with its raster, which is written unless an earlier run wrote it."""
        assert one.date is not None and one.transform is not None
        key, before = self.raster_key(one, series), stored.dates.get(one.name)
        if before is not None and before.key == key and self._stands(before, one.transform):
            has_written(self.folder / before.file)
            written = before
            with open_raster(self.folder / before.file) as source:
                grid = source.grid
        else:
            context.update(0.0, f"writing {one.name}")
            path = self.folder / registered_name(one.name)
            output = RegisteredOutput(path, self.output_grid, self.resampling)
            grid = output.write(one.date.source, series.map_grid, one.transform, outputs, context)
            state = state_of(outputs.staged(path))
            written = StoredDate(path.name, key, run_tags().get(RUN), state, one.transform)
        one = replace(one, transform=written.transform)
        share = series.share_beyond(one, self.output_grid)
        written = replace(written, outside_of_overlap=share)
        return replace(one, written=written, item=self._item(one, series, written.file, grid))

    def _stands(self, before: StoredDate, transform: Transform) -> bool:
        """Return whether a raster is as an earlier run left it, and where a transform puts it."""
        if not before.is_untouched(self.folder):
            return False
        corners = transform.input_grid.outline(2)
        moved = transform(before.transform.inverse(corners)) - corners
        # The tolerance that untouched pixels have, too.
        return bool(np.hypot(*moved.T).max() < UNTOUCHED_TOLERANCE_PX)

    def _item(self, one: SeriesDate, series: Series, file: str, grid: Grid) -> dict[str, Any]:
        """Return the STAC item of a registered date; empty if there can be none."""
        assert one.date is not None and one.transform is not None
        covariance = one.verdict.covariance
        assert covariance is not None
        quality = {
            "accuracy:geometric_rmse": series.frame.sigma_m(covariance),
            "groundtie:worst_loop_px": one.verdict.worst_loop_px,
            "groundtie:model": one.transform.model.kind,
        }
        path, time = self.folder / file, one.listed.time
        return stac_item(one.date.source, path, grid, self.folder, quality, time)

    def _write_report(self, series: Series, outputs: Outputs) -> None:
        if self.report is not None:
            from .report import SeriesReport  # matplotlib and jinja2 are heavy

            SeriesReport.of(series).write(outputs, self.report)

    def _remove_stale(self, series: Series, stored: StoredSeries) -> None:
        """Remove rasters of dates that are left out now: they must not seem to be registered."""
        current = {one.written.file for one in series.dates if one.written is not None}
        for one in stored.dates.values():
            if one.file not in current and one.is_own(self.folder):
                with writing(self.folder / one.file):
                    (self.folder / one.file).unlink()

    def _remove_tables(self) -> None:
        """Remove the tables and `series.json` of an earlier run, if there was one."""
        if (self.folder / SERIES_JSON).exists():
            # `series.json` last: if removal is interrupted, the next run goes on by it.
            for name in (TABLE_CSV, TABLE_GPKG, SERIES_JSON):
                with writing(self.folder / name):
                    (self.folder / name).unlink(missing_ok=True)


def registered_name(date: str) -> str:
    """Return the file name of a date's registered raster."""
    return f"{date}_registered.cog.tif"


def _write_layer(path: Path, series: Series) -> None:
    """Write the table with the outline of each date as registered."""
    records = [
        {"geometry": _outline(one), "properties": dict(row)}
        for one, row in zip(series.dates, series.rows(), strict=True)
    ]
    with writing(path):
        write_vector_layer(path, "series", records, TABLE_COLUMNS, series.frame.grid.crs)


def _outline(one: SeriesDate) -> Mapping[str, Any] | None:
    if one.transform is None:
        return None
    around = one.transform.inverse(one.transform.input_grid.outline(1)).tolist()
    return {"type": "LineString", "coordinates": [*around, around[0]]}


def _refusal(series: Series) -> NotRegisteredError:
    reasons = dict.fromkeys(one.verdict.reason for one in series.left_out)
    count = len(series.left_out)
    message = f"none of {count} dates was registered: {'; '.join(reasons)}"
    return NotRegisteredError(
        message, Verdict(False, message, rule=series.left_out[0].verdict.rule)
    )
