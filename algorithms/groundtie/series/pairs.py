"""One registration of the network: two dates, registered by the pipeline and its rules."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..context import Context, threads
from ..errors import (
    CancelledError,
    GroundTieError,
    MemoryLimitError,
    OutputError,
    RasterOpenError,
    WorkerLostError,
)
from ..executors import enter_worker
from ..geometry.estimation import jackknife_deviations
from ..geometry.models import Model
from ..matching.alignment import LINEAR_CANDIDATES
from ..memory import bounded_cache
from ..rasters.grid import FloatArray, Grid, reproject
from ..registration.opening import pair_images
from ..registration.pipeline import run
from ..registration.registration import Registration
from ..registration.specification import COREGISTER, SAR_SAR, Specification
from ..runs import digest
from ..version import __version__
from .dates import Date, open_dates
from .frame import PARAMETERS, SeriesFrame
from .inputs import Listed
from .network import Link

# Two images of one kind of camera have the same gradients: orientation alone finds as many matches
# as all measures together, in half of the time (suite series).
_CAMERAS = replace(COREGISTER, similarity="orientation")

# Errors that may not recur at another time or on another machine: a full disk, a network, memory.
_PASSING = (MemoryLimitError, OutputError, RasterOpenError)


@dataclass(frozen=True)
class Settings:
    """How each pair is registered.

    Parameters
    ----------
    model
        "auto", "translation", "similarity" or "affine".
    max_error_px, search_radius_m, matching_pixel_size_m, is_placed
        See `Specification`.
    band
        The band of the files that is matched, from 1; None: the mean of all.
    """

    model: str
    max_error_px: float
    search_radius_m: float | None
    matching_pixel_size_m: float | None
    is_placed: bool = False
    band: int | None = None

    def of_loops(self) -> Settings:
        """Return the settings of a pair that places no date, but closes a loop."""
        return replace(self, is_placed=True)

    def specification(self, first: Date, second: Date) -> Specification:
        """Return the specification of a pair, by the kinds of the two images."""
        preset = COREGISTER
        if first.is_radar == second.is_radar:
            preset = SAR_SAR if first.is_radar else _CAMERAS
        return replace(
            preset,
            model=self.model,
            candidates=LINEAR_CANDIDATES,
            max_error_px=self.max_error_px,
            search_radius_m=self.search_radius_m,
            matching_pixel_size_m=self.matching_pixel_size_m,
            is_placed=self.is_placed,
        )


@dataclass(frozen=True)
class PairResult:
    """The result of registering one date to another.

    Parameters
    ----------
    first, second
        Names of the dates: reference and input.
    key
        Digest of the files, the settings and the version; empty: the registration failed for a
        passing reason and is done again in the next run.
    accepted, rule, reason
        The verdict; without a rule, the registration failed and was not judged.
    check_rmse_px
        Error at check points, in matching pixels; None: there is none.
    displacement, covariance
        See `network.Link`; None if it was refused.
    seconds
        Duration.
    is_placed
        Whether the hub had placed both dates (see `Specification`).
    """

    first: str
    second: str
    key: str
    accepted: bool
    rule: str
    reason: str
    check_rmse_px: float | None = None
    displacement: tuple[float, ...] | None = None
    covariance: tuple[tuple[float, ...], ...] | None = None
    seconds: float = 0.0
    is_placed: bool = False

    def link(self, first: int, second: int) -> Link:
        """Return an accepted registration as a link of two dates by their numbers."""
        assert self.displacement is not None and self.covariance is not None
        return Link(first, second, np.array(self.displacement), np.array(self.covariance))

    def to_json(self) -> dict[str, Any]:
        """Return the result as JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> PairResult:
        """Return the result that `to_json` described.

        Raises
        ------
        KeyError, TypeError, ValueError
            The values describe no result.
        """
        found = cls(**values)
        if not found.accepted:
            return found
        return found.placed(np.array(found.displacement, float), np.array(found.covariance, float))

    def placed(self, displacement: FloatArray, covariance: FloatArray) -> PairResult:
        """Return the result as accepted, with a displacement, (6,), and its covariance, (6, 6)."""
        covariance = covariance.reshape(PARAMETERS, PARAMETERS)
        return replace(
            self,
            accepted=True,
            displacement=tuple(displacement.reshape(PARAMETERS).tolist()),
            covariance=tuple(map(tuple, covariance.tolist())),
        )


def pair_key(first: Date, second: Date, settings: Settings, frame: SeriesFrame) -> str:
    """Return the key of a registration, which need not be done again while the key is the same."""
    grid = frame.grid
    place = grid.transform, str(grid.crs), frame.centre_px, frame.half_px
    return digest(first.key, second.key, settings, place, __version__)


@dataclass(frozen=True)
class PairTask:
    """A registration of one date to another, to be done.

    Parameters
    ----------
    first, second
        Reference and input.
    placed
        Displacements of both, (6,), as far as known: the search starts from them.
    settings
        How the pair is registered.
    frame
        The series' frame.
    """

    first: Date
    second: Date
    placed: tuple[FloatArray | None, FloatArray | None]
    settings: Settings
    frame: SeriesFrame

    def lost(self, error: WorkerLostError) -> PairResult:
        """Return the result if the task's worker was lost."""
        return _failed(self.first.name, self.second.name, error.one_line())

    def elsewhere(self) -> Callable[[], PairResult]:
        """Return the task for another process, with files instead of pixels."""
        dates = self.first, self.second
        listed = [date.listed.anywhere() for date in dates]
        key = pair_key(*dates, self.settings, self.frame)
        return partial(_register_files, listed, key, self.placed, self.settings, self.frame)


def _register_files(
    listed: Sequence[Listed], key: str, placed: Any, settings: Settings, frame: SeriesFrame
) -> PairResult:
    enter_worker()
    with threads(1) as context, ExitStack() as stack:
        dates, failures = open_dates(listed, settings.band, stack, context, with_footprints=False)
        if failures:
            # The caller could open both files, so that the error may pass.
            return _failed(listed[0].name, listed[1].name, "; ".join(failures.values()))
        first, second = dates
        found = register_pair(PairTask(first, second, placed, settings, frame), context)
        return replace(found, key=key) if found.key else found


def _failed(first: str, second: str, reason: str) -> PairResult:
    """Return the result of a failed registration that the next run does again."""
    return PairResult(first, second, "", False, "", reason)


def register_pair(task: PairTask, context: Context) -> PairResult:
    """Register one date to another; the context supplies threads, progress and seed."""
    first, second, settings, frame = task.first, task.second, task.settings, task.frame
    started = time.perf_counter()
    key, is_placed = pair_key(first, second, settings, frame), settings.is_placed
    refused = PairResult(first.name, second.name, key, False, "", "", is_placed=is_placed)
    spec = settings.specification(first, second)
    grids = [
        date.source.grid if one is None else frame.moved_grid(date.source.grid, one)
        for date, one in zip((first, second), task.placed, strict=True)
    ]
    images = [date.image(grid) for date, grid in zip((first, second), grids, strict=True)]
    try:
        with ExitStack() as stack, bounded_cache():
            masks = first.pair_mask, second.pair_mask
            opened = pair_images(images[0], images[1], spec, context.quiet(), masks, stack, started)
            pair = replace(
                opened.pair,
                reference=first.masked(opened.pair.reference),
                input=second.masked(opened.pair.input),
            )
            found = run(replace(opened, pair=pair), spec, context)
    except CancelledError:
        raise
    except GroundTieError as error:
        # The error is this pair's alone: it is reported with the date, and other pairs stand.
        failed = replace(refused, key="") if isinstance(error, _PASSING) else refused
        return replace(failed, reason=error.one_line(), seconds=time.perf_counter() - started)
    verdict = found.verdict
    rmse = verdict.check_rmse_px
    judged = replace(
        refused,
        rule=verdict.rule,
        reason=verdict.reason,
        check_rmse_px=rmse if np.isfinite(rmse) else None,
        seconds=time.perf_counter() - started,
    )
    if not verdict.accepted:
        return judged
    return judged.placed(*_measured(found, first, second, grids, frame))


def _measured(
    found: Registration, first: Date, second: Date, grids: list[Grid], frame: SeriesFrame
) -> tuple[FloatArray, FloatArray]:
    """Return the displacement from one date's nominal positions to the other's, and its covariance.

    The covariance is that of the jackknife over blocks of points ([Efron1993] chapter 11).
    """
    assert found.evidence is not None
    estimate, grid = found.evidence.estimate, found.pair.grid

    def displacement(model: Any) -> FloatArray:
        return frame.displacement_of(lambda xy: _nominal(model, xy, first, second, grids, frame))

    def fold(px_model: Any) -> Any:
        return lambda xy: grid.pixel_to_map(px_model(grid.map_to_pixel(xy)))

    model: Model = estimate.transform.model
    # At least two folds: an accepted estimate has a finite jackknife.
    apart = jackknife_deviations([displacement(fold(one)) for one in estimate.fold_models])
    return displacement(model), apart.T @ apart


def _nominal(
    model: Any, xy: FloatArray, first: Date, second: Date, grids: list[Grid], frame: SeriesFrame
) -> FloatArray:
    """Return the second date's nominal positions of ground at the first date's positions.

    Both are positions on the series' map. The registration was between moved grids.
    """
    crs, own, other = frame.grid.crs, first.source.grid, second.source.grid
    px = own.map_to_pixel(reproject(xy, crs, own.crs))
    nominal = reproject(model(grids[0].pixel_to_map(px)), own.crs, other.crs)
    px = grids[1].map_to_pixel(nominal)
    return reproject(other.pixel_to_map(px), other.crs, crs)
