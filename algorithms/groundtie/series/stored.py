"""What `series.json` holds of an earlier run: nothing that is in it is done again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rasterio.errors import CRSError

from ..errors import GroundTieError, ParameterError, RasterOpenError
from ..geometry.transform import Transform
from ..rasters.reading import open_raster
from ..runs import RUN_TAG
from ..strict_json import read_json
from .frame import SeriesFrame
from .pairs import PairResult

FORMAT = "groundtie-series/1"


@dataclass(frozen=True)
class StoredDate:
    """A registered raster that an earlier run wrote.

    Parameters
    ----------
    file
        Its name in the folder.
    key
        Stands for what it was made of and how, but for the transform.
    run
        The id of the call that wrote it (see `runs`).
    transform
        By which it was made.
    """

    file: str
    key: str
    run: str | None
    transform: Transform

    def is_there(self, folder: Path) -> bool:
        """Return whether the file is there, as that call wrote it."""
        try:
            with open_raster(folder / self.file) as source:
                found = source.tags.get("", {}).get(RUN_TAG)
        except RasterOpenError:
            return False
        return found is not None and found == self.run


@dataclass(frozen=True)
class StoredSeries:
    """An earlier run in the same folder.

    Parameters
    ----------
    reference
        Key of the reference's file; None: there was none.
    frame
        Its frame; None: there was no earlier run.
    pairs
        Its registrations, by their keys.
    dates
        The rasters that it wrote, by the names of the dates.
    """

    reference: str | None = None
    frame: SeriesFrame | None = None
    pairs: Mapping[str, PairResult] = field(default_factory=dict)
    dates: Mapping[str, StoredDate] = field(default_factory=dict)


def read_series(path: Path) -> StoredSeries:
    """Return what a `series.json` holds; nothing, if there is no such file.

    Raises
    ------
    ParameterError
        There is such a file, but it is no series'.
    """
    if not path.exists():
        return StoredSeries()
    try:
        values = read_json(path)
        if values["format"] != FORMAT:
            raise ParameterError(f"not a {FORMAT} file but {values['format']!r:.60}")
        pairs = [PairResult.from_json(one) for one in values["pairs"]]
        return StoredSeries(
            values["reference_key"],
            SeriesFrame.from_json(values["frame"]),
            {pair.key: pair for pair in pairs},
            {one["name"]: _stored_date(one) for one in values["dates"] if one["written"]},
        )
    except (GroundTieError, OSError, KeyError, TypeError, ValueError, CRSError) as error:
        raise ParameterError(
            f"{path} is no series that can be continued ({error!s:.80}): give another folder, or "
            "remove it"
        ) from error


def _stored_date(values: dict[str, Any]) -> StoredDate:
    written = values["written"]
    return StoredDate(
        str(values["file"]),
        str(written["key"]),
        written["run"],
        Transform.from_json(values["transform"]),
    )
