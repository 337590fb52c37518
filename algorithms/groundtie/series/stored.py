"""Registrations that earlier runs have stored, so that they are not done again.

A completed run has stored all of them in `series.json`. A run that was cancelled or killed has left
a line for each registration in `series.unfinished.jsonl`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rasterio.errors import CRSError

from ..errors import GroundTieError, OutputError, ParameterError, RasterOpenError
from ..geometry.transform import Transform
from ..kinds import plain
from ..rasters.atomic import append_json, make_folder, writing
from ..rasters.hidden_files import remove
from ..rasters.reading import open_raster
from ..runs import RUN_TAG, digest, file_state
from ..strict_json import read_json, read_json_lines
from .frame import SeriesFrame
from .pairs import PairResult

FORMAT = "groundtie-series/1"
SERIES_JSON, UNFINISHED = "series.json", "series.unfinished.jsonl"


@dataclass(frozen=True)
class StoredDate:
    """A registered raster that a run wrote, with all that the next run needs to know of it.

    Parameters
    ----------
    file
        Its name in the folder.
    key
        Digest of all that it was made from, except the transform.
    run
        The id of the call that wrote it (see `runs`).
    state
        Digest of its size and time when it was written (see `state_of`).
    transform
        The transform that it was made with.
    outside_of_overlap
        Share of it outside of the overlap with other dates; None: none, or not known yet.
    """

    file: str
    key: str
    run: str | None
    state: str | None
    transform: Transform
    outside_of_overlap: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return all but the transform as JSON values."""
        return {name: value for name, value in vars(self).items() if name != "transform"}

    def is_untouched(self, folder: Path) -> bool:
        """Return whether the file is there, as that run left it."""
        return self.state is not None and state_of(folder / self.file) == self.state

    def is_own(self, folder: Path) -> bool:
        """Return whether the file is there and from that run, even if it was changed since."""
        try:
            with open_raster(folder / self.file) as source:
                found = source.tags.get("", {}).get(RUN_TAG)
        except RasterOpenError:
            return False
        return found is not None and found == self.run


@dataclass(frozen=True)
class StoredSeries:
    """Results that earlier runs left in a folder.

    Parameters
    ----------
    frames
        Their frames, by the keys of the references' files; None: there was no reference.
    pairs
        Their registrations, by their keys.
    dates
        The rasters that were written, by the names of the dates.
    """

    frames: Mapping[str | None, SeriesFrame] = field(default_factory=dict)
    pairs: Mapping[str, PairResult] = field(default_factory=dict)
    dates: Mapping[str, StoredDate] = field(default_factory=dict)


def state_of(path: Path) -> str | None:
    """Return a digest of the size and time of a file; None: there is no file."""
    state = file_state(path)
    # Nanoseconds have more digits than numbers in JSON.
    return None if state is None else digest(state)


def keep_unfinished(
    folder: Path, reference: str | None, frame: SeriesFrame, pair: PairResult
) -> None:
    """Keep a registration as soon as it is done, until the series is written.

    Parameters
    ----------
    folder
        The series' folder; it is made for the first registration.
    reference
        Key of the reference's file; None: there is no reference.
    frame
        The series' frame.
    pair
        The registration.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    values = {"reference_key": reference, "frame": frame.to_json(), "pair": pair.to_json()}
    path = folder / UNFINISHED
    make_folder(folder)
    is_first = not path.exists()
    try:
        append_json(path, plain(values))
    except OutputError:
        if is_first:
            remove(path)
        raise


def forget_unfinished(folder: Path) -> None:
    """Remove what `keep_unfinished` wrote."""
    path = folder / UNFINISHED
    with writing(path):
        path.unlink(missing_ok=True)


def read_series(folder: Path) -> StoredSeries:
    """Return the results that earlier runs left in a folder; empty if there were none.

    Raises
    ------
    ParameterError
        There is a `series.json`, but it describes no series.
    """
    started = _read_unfinished(folder / UNFINISHED)
    path = folder / SERIES_JSON
    if not path.exists():
        return started
    try:
        values = read_json(path)
        if values["format"] != FORMAT:
            raise ParameterError(f"not a {FORMAT} file but {values['format']!r:.60}")
        pairs = [PairResult.from_json(one) for one in values["pairs"]]
        frame = SeriesFrame.from_json(values["frame"])
        return StoredSeries(
            {**started.frames, values["reference_key"]: frame},
            {**started.pairs, **{pair.key: pair for pair in pairs}},
            {one["name"]: _stored_date(one) for one in values["dates"] if one["written"]},
        )
    except (GroundTieError, OSError, KeyError, TypeError, ValueError, CRSError) as error:
        raise ParameterError(
            f"{path} is no series that can be continued ({error!s:.80}): give another folder, or "
            "remove it"
        ) from error


def _read_unfinished(path: Path) -> StoredSeries:
    """Return the registrations of runs that did not end; lines without one are skipped."""
    frames: dict[str | None, SeriesFrame] = {}
    pairs: dict[str, PairResult] = {}
    for values in read_json_lines(path):
        with contextlib.suppress(GroundTieError, KeyError, TypeError, ValueError, CRSError):
            pair = PairResult.from_json(values["pair"])
            frames[values["reference_key"]] = SeriesFrame.from_json(values["frame"])
            pairs[pair.key] = pair
    return StoredSeries(frames, pairs)


def _stored_date(values: dict[str, Any]) -> StoredDate:
    written = values["written"]
    return StoredDate(
        str(values["file"]),
        str(written["key"]),
        written["run"],
        written["state"],
        Transform.from_json(values["transform"]),
    )
