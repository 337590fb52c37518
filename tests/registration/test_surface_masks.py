"""Masks by a surface model: its fit to the reference, and its requirements."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from contexts import context

from groundtie.context import Context
from groundtie.errors import NoOverlapError, ParameterError, RasterOpenError
from groundtie.geometry.views import View
from groundtie.masks.scene import Scene
from groundtie.masks.used import REFERENCE, SURFACE
from groundtie.rasters.grid import compose
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster
from groundtie.registration.asked import asked_surface
from groundtie.registration.masks import Masked
from groundtie.registration.scene import SceneInfo, scene_of
from groundtie.registration.specification import BOTH, INPUT, NEITHER, StatedSurface
from groundtie.registration.surface_masks import (
    ModelFit,
    fit_of_images,
    fitted_ground,
    with_surface_mask,
)
from groundtie.simulation.files import write_pair
from groundtie.simulation.optical import OpticalOptions
from groundtie.simulation.pair import PairOptions, simulate_pair
from groundtie.simulation.sar import SarOptions
from groundtie.simulation.scene import SceneOptions

__all__ = ["context"]


def simulated(folder: Path, seed: int) -> Path:
    options = PairOptions(
        SceneOptions((260, 240), density="city", seed=seed),
        SarOptions(incidence_deg=40, looks=2),
        OpticalOptions(off_nadir_deg=15, bands=("red",)),
    )
    write_pair(simulate_pair(options), folder)
    return folder


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("city"), 1)


@pytest.fixture(scope="module")
def other_city(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("other"), 2)


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


def stated(city: Path, model: Path | None = None) -> StatedSurface:
    views = [View.of(city / name, None) for name in ("reference.tif", "input.tif")]
    assert views[0] is not None and views[1] is not None
    return StatedSurface(model or city / "dsm.tif", (views[0], views[1]))


def pair_of(city: Path, stack: ExitStack, turned: bool = False) -> ImagePair:
    names = ("input.tif", "reference.tif") if turned else ("reference.tif", "input.tif")
    return make_pair(*(Image(stack.enter_context(open_raster(city / name))) for name in names))


def fit_on(scene: Scene, stated: StatedSurface, stack: ExitStack) -> ModelFit:
    """Return the fit of a model to a reference at its place."""
    _, fit = fitted_ground(scene, stated, stack)
    assert fit is not None
    return fit


def moved(model: Path, path: Path, east_m: float, north_m: float) -> Path:
    with rasterio.open(model) as raster:
        transform = compose(Affine.translation(east_m, north_m), raster.transform)
        profile = {**raster.profile, "transform": transform}
        with rasterio.open(path, "w", **profile) as copy:
            copy.write(raster.read())
    return path


def masked_by(
    pair: ImagePair, surface: StatedSurface, stack: ExitStack, context: Context
) -> Masked:
    return with_surface_mask(pair, SceneInfo.of(pair), surface, stack, context)


@pytest.mark.slow
def test_a_model_that_lies_right_is_found_there(city: Path, stack: ExitStack) -> None:
    fit = fit_on(scene_of(pair_of(city, stack), REFERENCE), stated(city), stack)
    assert fit.is_clear and max(np.abs(fit.offset_px)) <= 1


@pytest.mark.slow
def test_a_model_that_lies_off_is_moved_to_where_the_reference_shows_it(
    city: Path, stack: ExitStack, tmp_path: Path, context: Context
) -> None:
    pair = pair_of(city, stack)
    right = masked_by(pair, stated(city), stack, context)
    model = moved(city / "dsm.tif", tmp_path / "moved.tif", 7.0, 4.0)
    off = masked_by(pair, stated(city, model), stack, context)
    assert (right.used.kind, right.used.image) == (SURFACE, REFERENCE)
    assert right.used.is_ground and right.used.is_reliable and right.used.leaves_little
    assert right.used.elevated_px == pytest.approx(0.25)
    assert off.used.share == pytest.approx(right.used.share, abs=1e-3)
    assert "moved by -7 and +4 px" in off.used.reason
    parts = [
        masked.pair.reference.mask.read(masked.pair.reference.mask.window)[0]
        for masked in (right, off)
        if masked.pair.reference.mask is not None
    ]
    np.testing.assert_array_equal(*parts)


@pytest.mark.slow
def test_a_model_of_another_city_is_not_found(
    city: Path, other_city: Path, stack: ExitStack, context: Context
) -> None:
    other = stated(city, other_city / "dsm.tif")
    used = masked_by(pair_of(city, stack), other, stack, context).used
    assert not used.is_reliable and "shows nothing" in used.reason


@pytest.mark.slow
def test_a_view_from_the_other_side_is_not_the_references(city: Path, stack: ExitStack) -> None:
    pair, right = pair_of(city, stack), stated(city)
    other_side = replace(right.views[0], azimuth_deg=right.views[0].azimuth_deg - 180)
    wrong = replace(right, views=(other_side, right.views[1]))
    fits = [fit_on(scene_of(pair, REFERENCE), one, stack) for one in (right, wrong)]
    assert fits[0].correlation > 2 * fits[1].correlation


@pytest.mark.slow
def test_a_cameras_cast_shadows_show_where_the_model_lies(city: Path, stack: ExitStack) -> None:
    right = stated(city)
    turned = replace(right, views=right.views[::-1])
    fit = fit_on(scene_of(pair_of(city, stack, turned=True), REFERENCE), turned, stack)
    # The camera image is misregistered by 8 px and the warp.
    assert fit.is_clear and 3 <= np.hypot(*fit.offset_px) <= 14


@pytest.mark.slow
def test_nothing_is_expected_of_a_camera_without_the_sun(
    city: Path, stack: ExitStack, context: Context
) -> None:
    right, pair = stated(city), pair_of(city, stack, turned=True)
    camera = replace(right.views[1], sun_azimuth_deg=None, sun_elevation_deg=None)
    turned = replace(right, views=(camera, right.views[0]))
    masked = masked_by(pair, turned, stack, context)
    assert masked.used.is_reliable and "moved" not in masked.used.reason
    assert masked.surface is not None and masked.surface.offset_px == (0, 0)


def test_a_model_of_nowhere_is_refused(
    city: Path, stack: ExitStack, tmp_path: Path, context: Context
) -> None:
    pair = pair_of(city, stack)
    far = stated(city, moved(city / "dsm.tif", tmp_path / "far.tif", 50_000, 0))
    with pytest.raises(NoOverlapError, match="does not cover"):
        masked_by(pair, far, stack, context)


def test_views_tell_which_image_is_a_radars() -> None:
    radar, camera = View("radar", 90, 40), View("camera", 90, 10)
    assert StatedSurface("a.tif", (radar, camera)).radar == REFERENCE
    assert StatedSurface("a.tif", (camera, radar)).radar == INPUT
    assert StatedSurface("a.tif", (radar, radar)).radar == BOTH
    assert StatedSurface("a.tif", (camera, camera)).radar == NEITHER


def test_a_model_needs_both_views_and_a_view_a_model(city: Path, tmp_path: Path) -> None:
    given = {
        "reference": city / "reference.tif",
        "input": city / "input.tif",
        "surface_model": city / "dsm.tif",
        "views": None,
    }
    found = asked_surface(given, "input")
    assert found == stated(city)
    alone = shutil.copy(city / "input.tif", tmp_path / "alone.tif")
    with pytest.raises(ParameterError, match="view of the input is not known"):
        asked_surface({**given, "input": alone}, "input")
    with pytest.raises(RasterOpenError, match=r"cannot read .*nowhere\.tif"):
        asked_surface({**given, "input": tmp_path / "nowhere.tif"}, "input")
    with pytest.raises(ParameterError, match="go with a surface model"):
        view = "radar azimuth=90 incidence=40"
        asked_surface({**given, "surface_model": None, "views": view}, "input")
    assert asked_surface({**given, "surface_model": None}, "input") is None


def test_decibels_fit_a_model_as_their_amplitudes_do() -> None:
    random, valid = np.random.default_rng(0), np.ones((200, 200), bool)
    rendered = np.exp(random.normal(3.0, 1.0, valid.shape)).astype(np.float32)
    seen = np.roll(rendered, (3, -2), (0, 1)) * np.exp(random.normal(0, 0.5, valid.shape))
    decibels = 20 * np.log10(seen / seen.max())
    amplitude, level = (
        fit_of_images(Patch(rendered, valid), Patch(values.astype(np.float32), valid))
        for values in (seen, decibels)
    )
    assert amplitude.offset_px == level.offset_px == (-2, 3)
    assert level.correlation == pytest.approx(amplitude.correlation, abs=0.05)
    assert level.correlation > 0.8
