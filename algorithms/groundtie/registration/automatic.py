"""Registration for people who do not want to choose: the images decide what is tried.

Source: [Patel2017] section 6.2 leaves a "library of algorithms chosen by the image's
characteristics" as future work.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..context import Context, threads
from ..errors import GeoreferencingError, ParameterError
from ..kinds import AUTO
from ..matching.shared_content import Sensors
from ..progress import SILENT, Progress
from ..rasters.reading import open_raster
from ..sensor.rpc_files import rpc_of
from ..sensor.rpc_fit import RPCFit
from .asked import USUAL, asked_lights, asked_rendering, asked_surface_view, asked_terrain
from .delivery import Call
from .orthorectification import write_orthoimage
from .pipeline import run
from .refinement import RefinedRpc
from .refinement_output import RefinementFiles, WriteOutput
from .registration import Registration
from .scene import SceneInfo
from .sensor_input import Ground, OrientedImage
from .sensor_jobs import refine
from .specification import ANYWHERE, CHIPS, COREGISTER, OPTICAL, SAR_SAR, Specification

# Search range for georeferencing that is wrong by more than a shift, used if shifts are refused.
_DOUBTED_DEG, _DOUBTED_SCALE = 10.0, 1.1


@dataclass(frozen=True)
class Try:
    """One way to register a pair.

    Parameters
    ----------
    name
        The tool that does the same.
    spec
        How the pair is registered.
    because
        Why it was chosen.
    """

    name: str
    spec: Specification
    because: str


def plan(scene: SceneInfo, is_georeferenced: bool) -> tuple[Try, ...]:
    """Return the ways to try on a pair, in this order.

    Parameters
    ----------
    scene
        Facts about the images.
    is_georeferenced
        Whether they have georeferencing.
    """
    chips = Try("coregister", COREGISTER, "other images match by chips")
    if scene.apparent is Sensors.DIFFERENT:
        tries = [replace(chips, because="a radar image and a camera's match by chips")]
    elif scene.apparent is Sensors.RADARS:
        because = "both images look like a radar's"
        tries = [Try("match_sar_sar", SAR_SAR, because), chips]
    else:
        # Not declared to be cameras': an image without speckle may still be a radar's.
        spec = replace(OPTICAL, radar=COREGISTER.radar)
        because = "neither image looks like a radar's"
        tries = [Try("match_optical", spec, because), chips]
    first = tries[0]
    if is_georeferenced:
        wider = replace(first.spec, rotation_deg=_DOUBTED_DEG, scale=_DOUBTED_SCALE)
        because = f"rotated by up to {_DOUBTED_DEG:g}°, scaled by up to {_DOUBTED_SCALE:g}"
    else:
        wider = replace(first.spec, free=ANYWHERE)
        because = "with any rotation and scale"
    tries.append(Try(first.name, wider, because))
    if not is_georeferenced and first.name != chips.name:
        tries.append(replace(chips, spec=replace(chips.spec, free=ANYWHERE), because=because))
    return tuple(tries)


def plan_rendered(given: Mapping[str, Any]) -> Iterator[Try]:
    """Yield the ways to try if the reference holds heights, by a tool's parameters."""
    if asked_surface_view(given) is not None:
        because = "the reference is a surface model, rendered as the radar image"
        yield Try("coregister", replace(COREGISTER, **asked_rendering(given)), because)
        return
    for light in asked_lights(given):
        place = f"{light.kind} in {light.azimuth_deg:g}° from north"
        because = f"the reference is a terrain model, rendered with the {place}"
        yield Try("coregister", replace(COREGISTER, light=light), because)


def register_anything(
    parameters: Mapping[str, Any], progress: Progress
) -> Registration | RefinedRpc:
    """Register as the tool `register` does, from its parameters by name.

    Raises
    ------
    NotRegisteredError
        Every way that was tried was refused.
    """
    if _needs_rpcs(parameters["input"]):
        return _by_rpcs(parameters, progress)
    call = Call.of(parameters, progress)
    with threads(parameters["workers"], progress) as context:
        asked = asked_terrain(parameters) | {"max_error_px": parameters["max_error"]}
        ways = tuple(plan_rendered(parameters))
        if parameters["views"] is not None and not ways:
            raise ParameterError("register takes the view of a terrain or surface model only")
        found, stack = _first_accepted(call, asked, ways, context.part(0.0, 0.7))
        return call.deliver(found, context.part(0.7, 1.0), stack)


def _first_accepted(
    call: Call, asked: Mapping[str, Any], ways: tuple[Try, ...], context: Context
) -> tuple[Registration, ExitStack]:
    """Return the first registration that is final, accepted or refused; else the first refusal.

    `asked` is added to every way's specification; without `ways`, the images decide on them.
    """
    tried: list[str] = []
    with ExitStack() as stack:
        first = ways[0].spec if ways else COREGISTER
        opened = stack.enter_context(call.open(first, context.part(0.0, 0.02)))
        scene = SceneInfo.of(opened.pair, first.radar)
        is_georeferenced = opened.pair.input.source.grid.is_georeferenced
        ways = ways or plan(scene, is_georeferenced)
        if asked["dem"] is not None:
            ways = tuple(way for way in ways if way.spec.matcher == CHIPS)
        found, tries = [], 0
        for number, way in enumerate(ways, start=1):
            part = context.part((number - 1) / len(ways), number / len(ways))
            spec = replace(way.spec, **asked, tries=tries + 1)
            images = call.with_limits(opened, spec, part)
            is_same = images.pair.surroundings == opened.pair.surroundings
            found.append(run(images, spec, part, scene if is_same else None))
            verdict, tries = found[-1].verdict, found[-1].spec.tries
            word = "accepted" if verdict.accepted else f"refused ({verdict.reason})"
            tried.append(f"{way.name}, as {way.because}: {word}")
            if verdict.is_final:
                break
        chosen = found[-1] if found[-1].verdict.is_final else found[0]
        return replace(chosen, tried=tuple(tried)), stack.pop_all()


def _needs_rpcs(raster: Any) -> bool:
    """Whether a raster is in the geometry of its sensor, and has RPCs."""
    with open_raster(raster, allow_sensor_geometry=True) as source:
        if source.grid.is_georeferenced:
            return False
        try:
            rpc_of(source)
        except GeoreferencingError:
            return False
        return True


def _by_rpcs(parameters: Mapping[str, Any], progress: Progress) -> RefinedRpc:
    """Refine the RPCs of the input on the reference, and orthorectify it."""
    given = {**USUAL, **_RPC_DEFAULTS, **parameters}
    for name in ("input_dem", "views"):
        if given[name] is not None:
            raise ParameterError(f"{name} is for orthoimages, not for an image with RPCs")
    for name in ("transform", "displacement"):
        if given[name] is not None:
            raise ParameterError(
                f"an image with RPCs is orthorectified: there is no {name} to write"
            )
    if given["output"] is None:
        raise ParameterError("an image with RPCs is orthorectified: give an output")
    output, points, report = given["output"], given["tie_points"], given["report"]
    ground, workers = Ground(given["dem"], given["dem_datum"]), given["workers"]
    files = RefinementFiles(output, points, report, parameters, _orthorectifier(ground, workers))
    given |= {
        "image": given["input"],
        "image_band": given["input_band"],
        "image_mask": given["input_mask"],
        "residuals": points,
        # The RPCs themselves are not written.
        "output": None,
    }
    refined = refine(given, progress, files)
    return replace(refined, tried=("refine_rpc: the input has RPCs",))


def _orthorectifier(ground: Ground, workers: int | None) -> WriteOutput:
    """Return the function that writes the orthoimage by refined RPCs."""

    def write(image: OrientedImage, fit: RPCFit, path: Path, progress: Progress) -> None:
        with threads(workers, progress) as context, ExitStack() as stack:
            # Oriented again: with the wrong RPCs, heights of another region were read.
            crs = image.orientation.crs
            refined = ground.orient(image.source, fit.rpc, crs, stack, SILENT)
            write_orthoimage(refined, path, context)

    return write


# Parameters of `refine` that the tool `register` does not have.
_RPC_DEFAULTS: Mapping[str, Any] = {
    **dict.fromkeys(("gcps", "geoid", "height", "rpc", "search_radius", "matching_pixel_size")),
    "dem_cover": 0.0,
    "model": AUTO,
}
