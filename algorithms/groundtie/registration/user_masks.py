"""Masks that the user gave, or that a mission delivers with an image.

Rasters, vector layers and classifiers all become a raster that masks one image of the pair.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..context import Context
from ..errors import ParameterError
from ..features.classified import ClassifiedScene
from ..features.classifier import read_classifier
from ..masks.beside import mask_beside
from ..masks.layer import read_layer
from ..masks.regions import WIDTH_M
from ..masks.scene import Scene, Select, Selection, write_mask
from ..masks.used import INPUT, LAYER, NONE, REFERENCE, MaskUsed
from ..masks.values import INSIDE, RasterMask, mask_values
from ..progress import Progress
from ..raster_names import file_name, raster_name
from ..rasters.atomic import scratch_folder
from ..rasters.pair import Image, ImagePair
from ..rasters.reading import RasterSource, Window, open_raster
from .scene import located, scene_of

_CLASSIFIER_SUFFIX = ".json"
_VECTOR_SUFFIXES = (".gpkg", ".geojson", ".shp", ".fgb", ".kml", ".gml")


@dataclass(frozen=True)
class UserMask:
    """A mask that the user gave, or that lies beside an image.

    Parameters
    ----------
    mask
        A raster, a vector layer or a classifier.
    values
        The values that take no part, see `masks.values`; None: zeros of a raster, the outside of a
        vector layer.
    origin
        Words on where it was found; empty: the user gave it.
    """

    mask: Any
    values: str | None = None
    origin: str = ""

    @classmethod
    def of(cls, image: Any, mask: Any, values: str | None) -> UserMask | None:
        """Return the requested mask of an image, or the one that lies beside it.

        Parameters
        ----------
        image
            The image, as `open_raster` takes it.
        mask, values
            The requested mask and values; values "none" without a mask: none is looked for.

        Raises
        ------
        ParameterError
            The values are invalid, or there is no mask that they belong to.
        """
        if mask is None and values not in (None, NONE):
            raise ParameterError(f"there is no mask that the values {values} belong to")
        if mask is None:
            is_named = values is None and isinstance(image, (str, Path))
            found = mask_beside(raster_name(image)) if is_named else None
            if found is None:
                return None
            path, scheme = found
            return cls(path, scheme, f", found beside {file_name(image)},")
        if values is not None:
            _check_values(mask, values)
        return cls(mask, values)

    @property
    def is_zeros(self) -> bool:
        """Whether it is a raster whose zeros take no part."""
        return self.is_raster and self.values is None

    @property
    def is_raster(self) -> bool:
        """Whether it is a raster: in memory, or by the ending of its name."""
        if not isinstance(self.mask, (str, Path)):
            return True
        return self._suffix not in (_CLASSIFIER_SUFFIX, *_VECTOR_SUFFIXES)

    @property
    def is_layer(self) -> bool:
        """Whether it is a vector layer."""
        return not self.is_raster and self._suffix in _VECTOR_SUFFIXES

    @property
    def is_drawn(self) -> bool:
        """Whether it is a raster, or a layer of areas to leave out: others depend on the pair."""
        return self.is_raster or (self.is_layer and self.values is not None)

    @property
    def _suffix(self) -> str:
        return Path(file_name(self.mask)).suffix.lower()

    @property
    def name(self) -> str:
        """Its name in messages."""
        named = isinstance(self.mask, (str, Path))
        return file_name(self.mask) if named else str(getattr(self.mask, "name", "the mask"))

    def noted(self, image: Image, share: float, of: object) -> Image:
        """Return an image with a note on this mask and the share that it keeps."""
        note = f"{self.name}{self.origin} keeps {share:.0%} of {of}"
        return replace(image, mask_note=note, mask_hides=self.values is not None)

    def summary(self) -> dict[str, Any]:
        """Return it as values that JSON can carry."""
        return {"name": self.name, "values": self.values, "found_beside": bool(self.origin)}


def _check_values(mask: Any, values: str) -> None:
    given = UserMask(mask)
    if given.is_layer and values != INSIDE:
        raise ParameterError(f"the only value of a vector layer is {INSIDE}, not {values!r}")
    if given.is_raster:
        mask_values(values)
    elif not given.is_layer:
        raise ParameterError(f"a classifier has no values: {values!r}")


def with_user_masks(
    pair: ImagePair, masks: tuple[Any, Any], stack: ExitStack, context: Context
) -> tuple[ImagePair, MaskUsed | None]:
    """Return a pair with the masks that the user gave.

    Parameters
    ----------
    pair
        The images.
    masks
        For the reference and the input a `UserMask`, or a mask to make one of; None: no mask.
    stack
        Keeps the masks' rasters until it is closed.
    context
        Threads and progress.

    Returns
    -------
    pair, used
        The pair, and the mask of the ground that a vector layer made; None: there is none.
    """
    used = None
    for name, given in zip((REFERENCE, INPUT), masks, strict=True):
        if given is None:
            continue
        mask = given if isinstance(given, UserMask) else UserMask(given)
        if mask.is_zeros:
            raster = stack.enter_context(open_raster(mask.mask))
            image: Any = getattr(pair, name).masked(raster, pair.grid)
            image = replace(image, mask_note=f"{mask.name} masks the {name}: its zeros")
            pair = replace(pair, **{name: image})
            continue
        scene = scene_of(pair, name)
        if mask.is_layer or mask.values is not None:
            select = select_drawn(scene, mask, stack)
        else:
            select = _scene_classifier(pair, name, scene, Path(mask.mask)).select
        pair, share = with_mask(pair, name, scene, select, stack, context)
        if mask.is_layer and mask.values is None:
            used = MaskUsed(LAYER, name, share, f"what {mask.name} covers")
        image = mask.noted(getattr(pair, name), share, f"the {name}")
        pair = replace(pair, **{name: image})
        context.update(1.0, image.mask_note)
    return pair, used


def select_drawn(scene: Scene, mask: UserMask, stack: ExitStack) -> Select:
    """Return a function that selects the pixels that a layer, or a raster's values, keep."""
    if mask.is_layer:
        layer = read_layer(mask.mask, scene, WIDTH_M)
        return replace(layer, is_outside=mask.values is not None).select
    assert mask.values is not None
    source = stack.enter_context(open_raster(mask.mask))
    return RasterMask(scene, source, mask_values(mask.values)).select


def _scene_classifier(pair: ImagePair, name: str, scene: Scene, path: Path) -> ClassifiedScene:
    """Return a classifier applied to one image of a pair.

    Raises
    ------
    ParameterError
        The file is no classifier, or one for another number of bands.
    """
    classifier = read_classifier(path)
    (image, to_px), count = located(pair, name), len(scene.like.image_bands)
    if classifier.bands not in (0, count):
        raise ParameterError(
            f"{path} was trained on an image of {classifier.bands} bands; "
            f"{image.source.path} has {count}"
        )
    grid = scene.grid
    return ClassifiedScene(scene, lambda at: image.bands_onto(grid.window(*at), to_px), classifier)


def with_mask(
    pair: ImagePair,
    name: str,
    scene: Scene,
    select: Select,
    stack: ExitStack,
    context: Context,
) -> tuple[ImagePair, float]:
    """Return a pair with a mask on one image, and the share of it that takes part.

    The mask's file exists until the stack is closed.
    """
    mask, share = drawn_mask(scene, select, stack, context.quiet().progress)
    return replace(pair, **{name: getattr(pair, name).masked(mask, pair.grid)}), share


def drawn_mask(
    scene: Scene, select: Select, stack: ExitStack, progress: Progress
) -> tuple[RasterSource, float]:
    """Return the mask of a scene, a file until the stack is closed, and the share it keeps."""
    path = stack.enter_context(scratch_folder()) / "mask.tif"
    share = write_mask(scene, path, select, progress)
    return stack.enter_context(open_raster(path)), share


def draw_mask(source: RasterSource, mask: UserMask, stack: ExitStack, progress: Progress) -> Image:
    """Return an image with a mask on its own pixels, so that the mask moves with them.

    Parameters
    ----------
    source
        The image.
    mask
        Its mask, for which `UserMask.is_drawn` must hold.
    stack
        Keeps the drawn mask until it is closed.
    progress
        Receives every tile.
    """
    scene = Scene.of(source)
    with ExitStack() as own:
        draw = _select_zeros if mask.is_zeros else select_drawn
        raster, share = drawn_mask(scene, draw(scene, mask, own), stack, progress)
    return mask.noted(replace(Image(source), mask=raster), share, source.path)


def _select_zeros(scene: Scene, mask: UserMask, stack: ExitStack) -> Select:
    """Return a function that selects the pixels of an image that a raster's zeros leave."""
    grid = scene.grid
    image = Image(scene.like).masked(stack.enter_context(open_raster(mask.mask)), grid)

    def select(window: Window) -> Selection:
        valid = scene.read(window).valid
        shown = image.shown_on(grid.window(*window), grid.map_to_pixel)
        return Selection(valid & shown, valid)

    return select
