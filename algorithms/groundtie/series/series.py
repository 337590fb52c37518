"""A registered series: its dates, their places, and the files in its folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..declaration import file_lines, given_files
from ..geometry.transform import Transform
from ..kinds import plain
from ..rasters.grid import FloatArray, Grid
from ..registration.registered_output import BeyondOverlap
from ..report.page import made
from .dates import Date
from .frame import SeriesFrame, rms_px, sigma_px
from .inputs import Listed
from .pairs import PairResult
from .settling import DateVerdict, Settled
from .stored import FORMAT, StoredDate

TABLE_COLUMNS = {
    "name": "str",
    "time": "str",
    "state": "str",
    "rule": "str",
    "reason": "str",
    "file": "str",
    "shift_x_px": "float",
    "shift_y_px": "float",
    "shift_x_m": "float",
    "shift_y_m": "float",
    "rms_px": "float",
    "sigma_px": "float",
    "links": "int",
    "loops": "int",
    "open_loops": "int",
    "worst_loop_px": "float",
    "confirmed": "bool",
    "outside_of_overlap": "float",
}


@dataclass(frozen=True)
class SeriesDate:
    """One date of a registered series.

    Parameters
    ----------
    listed
        The date as the user named it.
    verdict
        Whether it belongs to the series.
    date
        The opened date; None: it could not be opened.
    transform
        From the series' map to the date's pixels; None: the date is left out.
    is_reference
        Whether the date is the reference, which stays as it is.
    written
        The date's registered raster; None: there is none.
    item
        STAC item of that raster; empty: there is none.
    """

    listed: Listed
    verdict: DateVerdict
    date: Date | None = None
    transform: Transform | None = None
    is_reference: bool = False
    written: StoredDate | None = None
    item: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The date's name."""
        return self.listed.name

    @property
    def is_registered(self) -> bool:
        """Whether the date was registered: it is not left out, not the reference, and has links."""
        return self.verdict.accepted and not self.is_reference and self.verdict.evidence.links > 0

    def row(self, frame: SeriesFrame) -> dict[str, Any]:
        """Return the date's row of the table; shifts lead to nominal positions of its ground."""
        verdict, evidence, written = self.verdict, self.verdict.evidence, self.written
        values: dict[str, Any] = dict.fromkeys(TABLE_COLUMNS)
        state = "registered" if verdict.accepted else "left out"
        values |= {
            "name": self.name,
            "time": None if self.listed.time is None else self.listed.time.isoformat(),
            "state": "reference" if self.is_reference else state,
            "rule": verdict.rule,
            "reason": "all dates are registered to it" if self.is_reference else verdict.reason,
            "file": None if written is None else written.file,
            "links": evidence.links,
            "loops": evidence.loops,
            "open_loops": evidence.open_loops,
            "worst_loop_px": verdict.worst_loop_px,
            "confirmed": evidence.is_confirmed,
            "outside_of_overlap": None if written is None else written.outside_of_overlap,
        }
        displacement, covariance = verdict.displacement, verdict.covariance
        if displacement is None or covariance is None:
            return values
        values |= {
            "shift_x_px": float(displacement[0]),
            "shift_y_px": float(displacement[1]),
            "rms_px": rms_px(displacement),
            "sigma_px": sigma_px(covariance),
        }
        if not frame.grid.is_georeferenced:  # there are no metres
            return values
        centre = frame.square.leave(np.array([[0.0, 0.0], displacement[:2] / frame.half_px]))
        shift_m = (centre[1] - centre[0]) * frame.metres_per_unit
        return values | {"shift_x_m": float(shift_m[0]), "shift_y_m": float(shift_m[1])}


@dataclass(frozen=True)
class Series:
    """A series whose dates are registered to one frame.

    Parameters
    ----------
    dates
        All dates, also those that are left out, in the order of their times.
    frame
        The frame in which displacements are measured.
    map_grid
        The grid of registered rasters: that of the reference, else of the hub.
    datum
        What the dates are registered to, in words.
    pairs
        All registrations of two dates, those of earlier runs among them.
    settled
        The adjusted network and its loops.
    names
        Names of the dates that could be opened, by their numbers in the network.
    reference_key
        Digest of the reference's file; None: there is no reference.
    registered_pairs, reused_pairs
        Numbers of registrations that were done, and that were taken over from an earlier run.
    parameters
        All parameters of the tool.
    seconds
        Duration.
    files
        The files that were written, by name.
    """

    dates: tuple[SeriesDate, ...]
    frame: SeriesFrame
    map_grid: Grid
    datum: str
    pairs: tuple[PairResult, ...]
    settled: Settled
    names: tuple[str, ...]
    reference_key: str | None
    registered_pairs: int
    reused_pairs: int
    parameters: Mapping[str, Any]
    seconds: float = 0.0
    files: Mapping[str, Path] = field(default_factory=dict)

    @property
    def registered(self) -> tuple[SeriesDate, ...]:
        """The dates that were registered."""
        return tuple(date for date in self.dates if date.is_registered)

    @property
    def left_out(self) -> tuple[SeriesDate, ...]:
        """The dates that were refused."""
        return tuple(date for date in self.dates if not date.verdict.accepted)

    def transforms(self) -> dict[str, Transform]:
        """Return the transforms of all registered dates, by their names."""
        return {date.name: date.transform for date in self.dates if date.transform is not None}

    def rows(self) -> list[dict[str, Any]]:
        """Return the table, one row a date (see `TABLE_COLUMNS`)."""
        return [date.row(self.frame) for date in self.dates]

    def share_beyond(self, date: SeriesDate, grid: str) -> float | None:
        """Return the share of a registered date outside of all dates that it is linked with.

        None: there is no such part, as on the series' grid.

        Parameters
        ----------
        date
            The date.
        grid
            One of `registered_output.OUTPUT_GRIDS`.
        """
        assert date.transform is not None
        transforms, rejected = self.transforms(), {frozenset(one) for one in self.rejected}
        linked = {
            name
            for pair in self.pairs
            if pair.accepted and frozenset((pair.first, pair.second)) not in rejected
            for name in (pair.first, pair.second)
            if date.name in (pair.first, pair.second) and name != date.name
        }
        others = [transforms[name] for name in linked & transforms.keys()]

        def is_checked(xy: FloatArray) -> NDArray[np.bool_]:
            seen = [one.input_grid.contains(one(xy)) for one in others]
            return np.any(seen, axis=0)

        beyond = BeyondOverlap.of(grid, date.transform, is_checked)
        return None if beyond is None else beyond.share

    def beyond_line(self) -> str:
        """Return a line of text on the parts of dates that nothing has checked; empty: none."""
        written = {one.name: one.written for one in self.dates if one.written is not None}
        shares = {name: one.outside_of_overlap or 0.0 for name, one in written.items()}
        name = max(shares, key=lambda name: shares[name], default="")
        if not shares.get(name):
            return ""
        return (
            f"outside of the overlap with other dates: up to {shares[name]:.0%} of a registered "
            f"image ({name}), where nothing has checked the transform"
        )

    @property
    def rejected(self) -> list[list[str]]:
        """Names of the dates of each registration that contradicts the network."""
        return [[self.names[k] for k in ends] for ends in self.settled.rejected]

    def loops(self) -> dict[str, Any]:
        """Return the closures of triplets of dates as JSON values."""
        errors = [one.error_px for one in self.settled.closures]
        return {
            "closed": sum(one.is_closed for one in self.settled.closures),
            "count": len(errors),
            "median_px": float(np.median(errors)) if errors else None,
            "largest_px": max(errors, default=None),
            "scatter_px": self.settled.adjustment.scatter_px,
            "triplets": [
                {
                    "dates": [self.names[k] for k in one.dates],
                    "error_px": one.error_px,
                    "expected_px": one.expected_px,
                    "is_closed": one.is_closed,
                }
                for one in (*self.settled.open_closures, *self.settled.closures)
            ],
        }

    def summary(self) -> dict[str, Any]:
        """Return the result as JSON values."""
        values = {
            "verdict": {
                "accepted": bool(self.registered),
                "registered": len(self.registered),
                "left_out": len(self.left_out),
            },
            "datum": self.datum,
            "dates": self.rows(),
            "loops": self.loops(),
            "rejected_pairs": self.rejected,
            "registered_pairs": self.registered_pairs,
            "reused_pairs": self.reused_pairs,
            **made(self.parameters, self.seconds),
            "files": given_files(self.files),
        }
        found: dict[str, Any] = plain(values)
        return found

    def to_json(self) -> dict[str, Any]:
        """Return `summary` with all that the next run in the folder needs.

        The result is also a STAC item collection of the registered rasters.
        """
        values = self.summary()
        for row, date in zip(values["dates"], self.dates, strict=True):
            transform, written = date.transform, date.written
            row["transform"] = None if transform is None else transform.to_json()
            row["written"] = None if written is None else written.to_json()
            row["mask"] = None if date.listed.mask is None else date.listed.mask.summary()
            covariance = date.verdict.covariance
            row["covariance_px2"] = None if covariance is None else covariance.tolist()
        return {
            "format": FORMAT,
            "type": "FeatureCollection",
            "features": [plain(date.item) for date in self.dates if date.item],
            "reference_key": self.reference_key,
            "frame": self.frame.to_json(),
            **values,
            "pairs": [plain(pair.to_json()) for pair in self.pairs],
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        loops = self.loops()
        count = len(self.registered) + len(self.left_out)
        lines = [
            f"registered: {len(self.registered)} of {count} dates, {self.datum}",
            *(f"left out: {date.name}: {date.verdict.reason}" for date in self.left_out),
        ]
        masks = [date.listed.mask for date in self.dates if date.listed.mask is not None]
        if masks:
            beside = sum(bool(mask.origin) for mask in masks)
            lines.append(f"masks: of {len(masks)} dates, {beside} of them found beside the image")
        if loops["count"]:
            lines.append(
                f"loops that close: {loops['closed']} of {loops['count']}; error "
                f"{loops['median_px']:.2f} px (median), {loops['largest_px']:.2f} px (largest)"
            )
        if beyond := self.beyond_line():
            lines.append(beyond)
        reused = f", {self.reused_pairs} taken over" if self.reused_pairs else ""
        lines.append(f"registrations of two dates: {self.registered_pairs} done{reused}")
        return lines + file_lines(self.files)
