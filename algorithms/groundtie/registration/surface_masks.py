"""The mask from a surface model and the views of both images, and whether the model fits.

The mask keeps the ground without layover, occlusion or shadow in either image. It lies on the
reference, which, like the model, is placed correctly on the map. The input's place is not yet
known.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from ..context import Context
from ..geometry.views import View
from ..masks.object_heights import RasterModel, SurfaceModel, read_footprints
from ..masks.scene import Scene
from ..masks.shadow_direction import products_at_shifts
from ..masks.surface_model import SurfaceGround, write_image
from ..masks.used import REFERENCE, SURFACE, MaskUsed
from ..rasters.atomic import scratch_folder
from ..rasters.pair import Image, ImagePair
from ..rasters.patch import Patch, has_negative, middle_window
from ..rasters.reading import FloatImage, Window, open_raster
from .masks import Masked
from .scene import SceneInfo, scene_of
from .specification import StatedSurface
from .user_masks import UserMask, with_mask

# Search radius for the surface model.
_REACH_PX = 24

# Least correlation of an image with the model of its place. With models of other places it is up to
# 0.03; with the right one 0.27 and more, 0.44 in dense cities. With a view rotated by 90° or more
# it was up to 0.31; where such a registration was accepted, one of the images had 0.17 or less
# (suite towns).
CLEAR_CORRELATION = 0.2

# The same for a radar image and the model that it was registered to, rendered with layover: 0.56
# and more with rough models, also with an azimuth 15° off; 0.31 or less from 90° off on.
RENDERED_CORRELATION = 0.4

# Displacement of all points alike by the edges of objects and by objects that the model lacks:
# standard deviation along an axis, in matching pixels. Measured on suites rpc_city, seeds 75 to 84,
# and towns, seeds 131 to 140: without it CE90 holds 26 of 38 and 14 of 20 errors, with it 34 and
# 17.
_ON_MODELLED_GROUND_PX = 0.25

# Lower limit of brightness before the logarithm, as a share of the mean.
_DARKEST = np.float32(0.01)


def with_surface_mask(
    pair: ImagePair, scene: SceneInfo, stated: StatedSurface, stack: ExitStack, context: Context
) -> Masked:
    """Return a pair with a mask of the ground that both images show.

    Parameters
    ----------
    pair
        The images, with the masks that the user gave.
    scene
        Facts about the images.
    stated
        The surface model and the views.
    stack
        Keeps rasters until it is closed.
    context
        Threads and progress.

    Raises
    ------
    NoOverlapError
        The surface model covers nothing of the reference.
    """
    ground, fit = fitted_ground(scene_of(pair, REFERENCE), stated, stack)
    masked, share = with_mask(pair, REFERENCE, ground.scene, ground.select, stack, context)
    reason = f"ground that both images show by {stated.name}{fit.note if fit else ''}"
    is_reliable = fit is None or fit.is_clear
    used = MaskUsed(SURFACE, REFERENCE, share, reason, is_reliable, _ON_MODELLED_GROUND_PX)
    return Masked(masked, scene, used, ground)


def fitted_ground(
    scene: Scene, stated: StatedSurface, stack: ExitStack
) -> tuple[SurfaceGround, ModelFit | None]:
    """Return the ground that all views show, by a model moved to fit a scene, and the fit.

    Only a clear fit moves the model. The fit is None where the view predicts nothing.

    Parameters
    ----------
    scene
        The reference, whose view is the first.
    stated
        The surface model and the views.
    stack
        Keeps rasters until it is closed.

    Raises
    ------
    NoOverlapError
        The surface model covers nothing of the reference.
    """
    model: SurfaceModel
    if UserMask(stated.model).is_layer:
        model = read_footprints(stated.model, scene.grid)
    else:
        model = RasterModel(stack.enter_context(open_raster(stated.model)))
    ground = SurfaceGround(scene, model, stated.views)
    ground.require_cover()
    fit = fit_of(ground, ground.views[0], ground.scene.read)
    is_clear = fit is not None and fit.is_clear
    return (replace(ground, offset_px=fit.offset_px) if fit and is_clear else ground), fit


def rendered_surface(image: Image, view: View, stack: ExitStack, context: Context) -> Image:
    """Return a surface model rendered as a radar image; its file exists until the stack closes."""
    model = RasterModel(image.source, image.band or 1)
    ground = SurfaceGround(Scene.of(image.source, image.band), model, (view,))
    path = stack.enter_context(scratch_folder()) / "image.tif"
    write_image(ground, view, path, context.progress)
    source = stack.enter_context(open_raster(path))
    return Image(replace(source, path=image.source.path), 1)


@dataclass(frozen=True)
class ModelFit:
    """How well a surface model fits what an image shows.

    Parameters
    ----------
    correlation
        Of an image's logarithm with the image expected from the model, at the best offset.
    offset_px
        The best offset: columns and rows by which the image shows the model elsewhere.
    least
        The least correlation of an image that shows the model.
    """

    correlation: float
    offset_px: tuple[int, int]
    least: float = CLEAR_CORRELATION

    @property
    def is_clear(self) -> bool:
        """Whether the image shows the elevated objects of the model."""
        return self.correlation >= self.least

    @property
    def note(self) -> str:
        """A note for the user; empty: the model lies right."""
        if not self.is_clear:
            return ", of which it shows nothing"
        right, down = self.offset_px
        return f", moved by {right:+d} and {down:+d} px to fit it" if any(self.offset_px) else ""


def fit_of(ground: SurfaceGround, view: View, read: Callable[[Window], Patch]) -> ModelFit | None:
    """Return how well a surface model fits an image in the middle of the reference.

    Parameters
    ----------
    ground
        The ground by the model.
    view
        The view of the image.
    read
        Returns the image in a window of the reference.

    Returns
    -------
    None where the view predicts nothing: that of a camera without the sun's position.
    """
    window = middle_window(ground.scene.grid)
    patch, expected = read(window), ground.level(window, view)
    if expected.min() == expected.max():
        return None
    return _fit(expected, patch)


def fit_of_images(rendered: Patch, image: Patch) -> ModelFit:
    """Return how well an image fits one that was rendered from a surface model."""
    both = replace(image, valid=image.valid & rendered.valid)
    fit = _fit(_level(replace(rendered, valid=both.valid)), both)
    return replace(fit, least=RENDERED_CORRELATION)


def _fit(expected: FloatImage, patch: Patch) -> ModelFit:
    """Return how well the logarithm of an image, where it is valid, fits the expected image."""
    if not patch.valid.any():
        return ModelFit(0.0, (0, 0))
    surface = _correlation(_centred(expected, patch), _centred(_level(patch), patch))
    row, col = np.unravel_index(int(surface.argmax()), surface.shape)
    offset = int(col) - _REACH_PX, int(row) - _REACH_PX
    return ModelFit(float(surface[row, col]), offset)


def _level(patch: Patch) -> FloatImage:
    """Return the logarithm of an image's brightness, in any unit."""
    if not patch.valid.any():
        return np.zeros_like(patch.values)
    if has_negative(patch.values[patch.valid]):
        return patch.values
    return np.log(np.maximum(patch.values, patch.values[patch.valid].mean() * _DARKEST))


def _centred(values: FloatImage, patch: Patch) -> FloatImage:
    return np.where(patch.valid, values - values[patch.valid].mean(), np.float32(0))


def _correlation(model: FloatImage, image: FloatImage) -> FloatImage:
    """Return the correlation of an image with the model at all shifts, (2 r + 1, 2 r + 1)."""
    energy = max(float(np.linalg.norm(model) * np.linalg.norm(image)), 1e-12)
    return products_at_shifts(model, image, _REACH_PX) / energy
