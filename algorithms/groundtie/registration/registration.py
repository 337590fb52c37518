"""What registering tools share: their steps from two rasters to a judged transform, and its files.

rasters → ImagePair → rough shift → tie points → transform → verdict → output, report
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..errors import NothingFoundError, NotRegisteredError, SameFileError, TooFewPointsError
from ..geometry.estimation import Estimate
from ..geometry.judging import LARGEST_LOG10_CHANCE, LOG10_CHANCE_ON_GROUND
from ..geometry.models import Model
from ..geometry.tie_point_files import write_tie_points
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..masks.choice import MaskUsed
from ..matching.local import AUTO, LocalSearch
from ..matching.pyramid import find_coarse_model
from ..matching.rough import RoughSearch
from ..progress import Progress
from ..rasters.atomic import Outputs, writing
from ..rasters.pair import Image, ImagePair, Turn
from ..rasters.reading import open_raster
from ..report.report import Report
from ..similarity.surface import Surface
from ..studies.pose_searches import DEFAULT_SEARCH, SEARCHES
from .layover import leaning
from .registered_output import RegisteredOutput
from .verdict import Verdict, judge, refuse

# Without georeferencing images may lie this far off each other, as a share of the longer side.
_FREE_SHARE = 0.25

# What the ground says of a fit that was not made on it: it is itself good to a pixel or two.
_OFF_GROUND_PX = 1.0

# How many surfaces of the best and of the worst check points a report shows.
_EXTREMES = 3


class TiePointMatching(Protocol):
    """What finds tie points near a rough model without a look at held-out blocks, and a model."""

    def estimate(
        self, coarse: Model, kind: str, seed: int, executor: Executor, progress: Progress
    ) -> Estimate:
        """Return the model that tie points agree on; `TooFewPointsError` if none do."""


@dataclass(frozen=True)
class Registration:
    """A judged registration.

    Parameters
    ----------
    pair
        The images; their rasters are open.
    search
        How check points were searched for.
    estimate
        The transform and the points of its fit; None if there is none.
    check
        The check points; None without a transform.
    verdict
        Whether it can be trusted.
    """

    pair: ImagePair
    search: LocalSearch
    estimate: Estimate | None
    check: TiePoints | None
    verdict: Verdict

    @property
    def points(self) -> TiePoints | None:
        """All tie points, those of the fit first."""
        if self.estimate is None or self.check is None:
            return None
        return TiePoints.concatenate([self.estimate.points, self.check])

    def accepted(self) -> tuple[TiePoints, Transform]:
        """Return points and transform of a registration that was accepted, so that has both."""
        points, transform = self.points, self.transform
        assert self.verdict.accepted and points is not None and transform is not None
        return points, transform

    def extreme_surfaces(self) -> tuple[tuple[str, Surface], ...]:
        """Return the similarity surfaces of the check points with the best and worst residuals."""
        if self.check is None or self.estimate is None:
            return ()
        used = self.check.take(self.check.used)
        if len(used) == 0:
            return ()
        order = np.hypot(*used.residual_px(self.estimate.transform).T).argsort()
        best, worst = order[:_EXTREMES], order[_EXTREMES:][-_EXTREMES:]
        labels = ["best check point"] * len(best) + ["worst check point"] * len(worst)
        picked = used.take(np.concatenate([best, worst]))
        centres = np.rint(self.pair.grid.map_to_pixel(picked.reference_xy)).astype(int)
        surfaces = self.search.check_surfaces(self.estimate.transform.model, centres)
        return tuple(zip(labels, surfaces, strict=True))

    @property
    def transform(self) -> Transform | None:
        """The transform, whatever the verdict on it."""
        return None if self.estimate is None else self.estimate.transform


def open_image(
    stack: ExitStack, path: Path, band: int | None = None, mask: Path | None = None
) -> Image:
    """Open a raster and its mask, which `stack` closes."""
    shown = None if mask is None else stack.enter_context(open_raster(mask))
    return Image(stack.enter_context(open_raster(path)), band, shown)


def free_radius(input: Image) -> float | None:
    """Return how far an image without georeferencing may lie off, in pixels; None: it has some."""
    grid = input.source.grid
    return None if grid.is_georeferenced else _FREE_SHARE * max(grid.width, grid.height)


def turn_within(rotation_deg: float, largest_scale: float, search: str) -> Turn | None:
    """Return how far the input may be turned and scaled; None: shifts alone are searched for."""
    shifted = search == AUTO and rotation_deg == 0 and largest_scale == 1
    return None if shifted else Turn(rotation_deg, largest_scale)


def rough_search(radius_m: float, turn: Turn | None, search: str) -> RoughSearch:
    """Return the search of a name within limits; "auto": all shifts, or else rotation steps."""
    if turn is None:
        return RoughSearch(radius_m)
    poses = SEARCHES[DEFAULT_SEARCH if search == AUTO else search]
    scale = turn.largest_scale
    return RoughSearch(radius_m, turn.largest_deg, (1 / scale, scale), poses)


def register(
    pair: ImagePair,
    search: LocalSearch,
    rough: RoughSearch,
    model: str,
    max_error_px: float,
    seed: int,
    executor: Executor,
    progress: Progress,
    matching: TiePointMatching | None = None,
    judging: LocalSearch | None = None,
) -> Registration:
    """Register the input of a pair to its reference, and judge the result.

    Parameters
    ----------
    pair
        The images.
    search
        How tie points are searched for.
    rough
        How far the input may lie from where it claims to be, and how it is searched for.
    model
        One of `models.KINDS`, or "auto".
    max_error_px
        Largest error at check points, in matching pixels.
    seed
        Of random samples.
    executor
        Threads to work in.
    progress
        Is told of every step.
    matching
        What finds the tie points of the fit; None: `search`, on its chips.
    judging
        What finds the check points, whatever finds those of the fit; None: `search`.
    """
    matching, judging = matching or search, judging or search
    progress.update(0.0, "searching for the rough shift")
    try:
        coarse = find_coarse_model(pair, search, rough, executor, progress.part(0.0, 0.4))
        progress.update(0.4, "matching tie points")
        estimate = matching.estimate(coarse, model, seed, executor, progress.part(0.4, 0.8))
    except (NothingFoundError, TooFewPointsError) as error:
        return Registration(pair, judging, None, None, refuse(str(error)))
    progress.update(0.8, "checking with points that took no part")
    try:
        check = judging.check_points(estimate.transform.model, executor, progress.part(0.8, 1.0))
    except TooFewPointsError as error:
        return Registration(pair, judging, None, None, refuse(str(error)))
    chance = LOG10_CHANCE_ON_GROUND if judging.pooled else LARGEST_LOG10_CHANCE
    verdict = judge(estimate, check, pair.grid, max_error_px, judging.check_radius_px, chance)
    if verdict.accepted and judging is not search:
        off_px = judging.common_shift_px(estimate.transform.model, executor)
        if off_px > _OFF_GROUND_PX:
            reason = f"the ground alone matches {off_px:.1f} px elsewhere; give a mask of it"
            verdict = replace(verdict, accepted=False, reason=reason)
    return Registration(pair, judging, estimate, check, verdict)


def refuse_what_leans(
    registration: Registration, max_error_px: float, mean_over_scatter: float
) -> Registration:
    """Return a registration, refused if it may be that of roofs and canopies; see `leaning`."""
    if not registration.verdict.accepted:
        return registration
    assert registration.estimate is not None and registration.check is not None
    search, grid = registration.search, registration.pair.grid
    reason = leaning(
        registration.estimate,
        registration.check,
        grid,
        max_error_px,
        search.check_radius_px,
        mean_over_scatter,
    )
    return registration if reason is None else _refused(registration, reason)


def refuse_what_roofs_may_be(
    registration: Registration,
    lacks_speckle: Callable[[], bool],
    may_hide_a_town: Callable[[], bool],
) -> Registration:
    """Return a registration, refused if it may be that of the roofs of a dense town.

    Parameters
    ----------
    registration
        The registration.
    lacks_speckle
        Tells whether there is one, whose ground is not found for sure.
    may_hide_a_town
        Tells whether there may be one; asked only where so few check points agree as roofs do.
    """
    verdict = registration.verdict
    if not verdict.accepted:
        return registration
    if lacks_speckle():
        return _refused(
            registration,
            "the radar image of a dense town has no speckle, by which its ground is found: give it "
            "unfiltered, or a mask of the ground",
        )
    if verdict.is_clear or not may_hide_a_town():
        return registration
    return _refused(
        registration,
        f"only {verdict.check_points_agreeing} of {verdict.check_points} check points agree, as "
        "roofs may, and an image shines like a radar's of a dense town: if it is one, give it "
        "unfiltered, or a mask of the ground",
    )


def _refused(registration: Registration, reason: str) -> Registration:
    refused = replace(registration.verdict, accepted=False, reason=reason)
    return replace(registration, verdict=refused)


@dataclass(frozen=True)
class RegistrationFiles:
    """The files beside the registered raster; None: not asked for.

    Raises
    ------
    SameFileError
        The transform would be written where the report's numbers go.
    """

    tie_points: Path | None
    transform: Path | None
    report: Path | None

    def __post_init__(self) -> None:
        if self.numbers is not None and self.numbers == self.transform:
            raise SameFileError(
                f"the transform would be written over the report's numbers: {self.numbers}"
            )

    @property
    def numbers(self) -> Path | None:
        """Where the report's numbers go: beside it, as JSON."""
        return None if self.report is None else self.report.with_suffix(".json")

    def written(self) -> dict[str, Path]:
        """Return what is written, by name."""
        named = {"tie_points": self.tie_points, "transform": self.transform, "report": self.report}
        return {name: path for name, path in named.items() if path is not None}

    def write_report(self, report: Report, outputs: Outputs) -> None:
        """Write the report and its JSON, if they were asked for."""
        if self.report is not None and self.numbers is not None:
            report.write(outputs.stage(self.report), outputs.stage(self.numbers))

    def write_points(self, points: TiePoints, transform: Transform, outputs: Outputs) -> None:
        """Write tie points and transform, if they were asked for."""
        if self.tie_points is not None:
            write_tie_points(outputs.stage(self.tie_points), points, transform)
        if self.transform is not None:
            staged = outputs.stage(self.transform)
            with writing(staged):
                staged.write_text(json.dumps(transform.to_json(), indent=1), encoding="utf-8")


@contextmanager
def accepted_or_refused(
    registration: Registration, report: Report, files: RegistrationFiles
) -> Iterator[Outputs]:
    """Open the outputs of a registration; a refused one writes its report and raises.

    Raises
    ------
    NotRegisteredError
        The registration was refused.
    """
    verdict = registration.verdict
    with Outputs() as outputs:
        files.write_report(report, outputs)
        if verdict.accepted:
            yield outputs
    if not verdict.accepted:
        paths = [
            image.source.path for image in (registration.pair.input, registration.pair.reference)
        ]
        raise NotRegisteredError(
            f"{paths[0]} was not registered to {paths[1]}: {verdict.reason}", verdict
        )


@dataclass(frozen=True)
class RegistrationResult:
    """What a registering tool returns.

    Parameters
    ----------
    verdict
        Whether the registration can be trusted, and its errors.
    transform
        Reference map position ↔ input pixel position.
    points
        The tie points.
    numbers
        The same as the report's JSON.
    files
        What was written, by name.
    """

    verdict: Verdict
    transform: Transform
    points: TiePoints
    numbers: dict[str, Any]
    files: dict[str, str]

    @classmethod
    def of(
        cls, registration: Registration, numbers: dict[str, Any], files: dict[str, Path]
    ) -> RegistrationResult:
        """Return the result of an accepted registration."""
        points, transform = registration.accepted()
        return cls(
            registration.verdict,
            transform,
            points,
            numbers,
            {name: str(path) for name, path in files.items()},
        )

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {**self.numbers, "files": self.files}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        v = self.verdict
        return [
            f"accepted: {v.reason}",
            f"model: {self.transform.model.kind}, {v.fit_points_used} of {v.fit_points} points",
            f"error at check points: RMSE {v.check_rmse_px:.2f} px ({v.check_rmse_m:.2f} m), "
            f"CE90 {v.check_ce90_px:.2f} px ({v.check_ce90_m:.2f} m)",
            f"check points that agree: {v.check_points_agreeing} of {v.check_points}; by chance "
            f"1 in 10^{-v.log10_chance:.0f}",
            *(f"{name}: {path}" for name, path in self.files.items()),
        ]


def report_on(
    registration: Registration,
    parameters: Mapping[str, Any],
    started: float,
    mask: MaskUsed | None = None,
    with_surfaces: bool = True,
) -> Report:
    """Return the report on a registration; parameters as `deliver`.

    Without surfaces, its numbers are the same.
    """
    pair = registration.pair
    names = [Path(image.source.path).name for image in (pair.input, pair.reference)]
    return Report(
        title=f"{names[0]} registered to {names[1]}",
        verdict=registration.verdict,
        pair=pair,
        mask=mask,
        points=registration.points,
        transform=registration.transform,
        surfaces=registration.extreme_surfaces() if with_surfaces else (),
        parameters={k: v for k, v in parameters.items() if v is not None},
        seconds=time.perf_counter() - started,
    )


def deliver(
    registration: Registration,
    output: RegisteredOutput,
    files: RegistrationFiles,
    parameters: Mapping[str, Any],
    started: float,
    workers: int,
    progress: Progress,
    mask: MaskUsed | None = None,
) -> RegistrationResult:
    """Write what a registration leaves: the image and its files, or of a refused one the report.

    Parameters
    ----------
    registration
        The registration; its rasters are open.
    output
        How the registered image is made.
    files
        The files beside it.
    parameters
        What the tool was called with.
    started
        When, by `time.perf_counter`.
    workers
        Number of threads.
    progress
        Is told of every tile.
    mask
        Which mask was used; None: no question of one.

    Raises
    ------
    NotRegisteredError
        The registration was refused.
    """
    pair = registration.pair
    page = report_on(registration, parameters, started, mask, files.report is not None)
    with accepted_or_refused(registration, page, files) as outputs:
        points, found = registration.accepted()
        files.write_points(points, found, outputs)
        progress.update(0.0, "writing the registered image")
        output.write(pair, found, outputs, workers, progress)
    return RegistrationResult.of(
        registration, page.summary(), {"output": output.path, **files.written()}
    )
