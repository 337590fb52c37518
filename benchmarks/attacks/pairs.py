"""A pair of small images for attacks, with the true reference position of every input pixel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray

import groundtie
from groundtie.rasters.grid import Grid, PointFunction, compose

from ..accuracy import FloatArray, lattice
from ..cases import CRS, REFERENCE_TRANSFORM, write_image

Image = NDArray[np.uint8]
Change = Callable[[Image], Image]

NODATA = 0

# The error of a registration is this percentile of the errors over the overlap: it is silently
# wrong if more than a tenth of the overlap is.
ERROR_PERCENTILE = 90.0

# No error is measured from fewer known positions.
_FEWEST_KNOWN = 20


@dataclass(frozen=True)
class Source:
    """A whole scene, from which pairs are cut.

    Parameters
    ----------
    reference, input
        Bands of bytes, shape (bands, rows, columns); 0 holds no data.
    to_input
        Input (col, row) of reference (col, row), shapes (n, 2).
    """

    reference: Image
    input: Image
    to_input: PointFunction


@dataclass(frozen=True, eq=False)
class Pair:
    """A reference and an input, which an attack turns into another pair.

    Parameters
    ----------
    reference, input
        Bands of bytes, shape (bands, rows, columns); 0 holds no data.
    shown
        Reference pixel (col, row) that each input pixel shows, shape (rows, columns, 2). NaN: none,
        or not known. All are NaN where the images show different places.
    kind
        Kind of the pair, of `cases.KINDS`.
    sigma_px
        Uncertainty of the truth.
    source, corner
        The scene, and its reference pixel at which this reference begins.
    place
        The place that is shown.
    reference_transform, input_transform, reference_crs, input_crs
        The stated georeferencing; without a CRS, the map units are unknown.
    radius_px
        Search radius for tools that take one; None: their default.
    note
        The random choices, as text.
    """

    reference: Image
    input: Image
    shown: FloatArray
    kind: str
    sigma_px: float
    source: Source
    corner: tuple[int, int]
    place: str
    reference_transform: Affine = REFERENCE_TRANSFORM
    input_transform: Affine = REFERENCE_TRANSFORM
    reference_crs: str | None = CRS
    input_crs: str | None = CRS
    radius_px: float | None = None
    note: str = ""

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the input."""
        return self.input.shape[2], self.input.shape[1]

    def moved(self, shift_px: FloatArray, note: str | None = None) -> Pair:
        """Return the pair with the ground displaced in the input.

        Parameters
        ----------
        shift_px
            Displacement (right, down) of each input pixel's ground from its nominal place,
            shape (2,) or (rows, columns, 2).
        note
            Text to add to the note; None: the shift, which is one for all pixels.
        """
        note = as_text(shift_px) if note is None else note
        shown = pixels(self.size) - shift_px
        image, known = render(self.source, shown + np.array(self.corner))
        shown = np.where(known[..., None], shown, np.nan)
        return replace(self, input=image, shown=shown, note=join(self.note, note))

    def swapped(self) -> Pair:
        """Return the pair with the roles of the images exchanged; each keeps its georeferencing."""
        columns, rows = self.reference.shape[2], self.reference.shape[1]
        shown = np.full((rows, columns, 2), np.nan)
        known = np.isfinite(self.shown).all(axis=-1)
        at, place = pixels(self.size)[known], self.shown[known]
        near = np.rint(place).astype(int)
        inside = ((near >= 0) & (near < [columns, rows])).all(axis=1)
        at, place, near = at[inside], place[inside], near[inside]
        shown[near[:, 1], near[:, 0]] = at + (near - place)
        return replace(
            self,
            reference=self.input,
            input=self.reference,
            shown=shown,
            reference_transform=self.input_transform,
            input_transform=self.reference_transform,
            reference_crs=self.input_crs,
            input_crs=self.reference_crs,
            note=join(self.note, "reference and input exchanged"),
        )

    def changed(self, reference: Change | None, input: Change | None, note: str = "") -> Pair:
        """Return the pair with changed grey values; nodata stays nodata."""
        images = (
            image if change is None else _keep_nodata(image, change(image))
            for image, change in ((self.reference, reference), (self.input, input))
        )
        return replace(
            self,
            **dict(zip(("reference", "input"), images, strict=True)),
            note=join(self.note, note),
        )

    def both(self, change: Change, note: str = "") -> Pair:
        """Return the pair with the same change applied to both images."""
        return self.changed(change, change, note)

    def on_another_grid(self, scale: float, corner_px: FloatArray) -> Pair:
        """Return the pair with its input resampled to another pixel size and origin.

        Parameters
        ----------
        scale
            Pixels of the other grid per pixel of the input.
        corner_px
            Position of the first of them, (col, row) of the input, shape (2,).
        """
        to_old = compose(Affine.translation(*corner_px), Affine.scale(1 / scale))
        size = tuple(
            int((side - corner) * scale) for side, corner in zip(self.size, corner_px, strict=True)
        )
        at = (pixels(size) / scale + corner_px).astype(np.float32)
        cols, rows = at[..., 0], at[..., 1]
        near = np.rint(at).astype(int)
        near = np.minimum(near, np.array(self.size) - 1)
        shown = self.shown[near[..., 1], near[..., 0]] + (at - near)
        held = self.input.any(axis=0)[near[..., 1], near[..., 0]]
        bands = [
            cv2.remap(band, cols, rows, cv2.INTER_CUBIC, None, cv2.BORDER_REFLECT_101)
            for band in self.input
        ]
        half = Affine.translation(0.5, 0.5), Affine.translation(-0.5, -0.5)
        return replace(
            self,
            input=np.where(held, np.clip(np.stack(bands), 1, 255), NODATA).astype(np.uint8),
            shown=shown,
            input_transform=compose(self.input_transform, half[0], to_old, half[1]),
            note=join(self.note, f"{scale:.2f} times as many pixels"),
        )

    def within(self, radius_px: float) -> Pair:
        """Return the pair with a search radius for the tool."""
        note = join(self.note, f"radius {radius_px:.1f} px")
        return replace(self, radius_px=radius_px, note=note)

    def arguments(self) -> dict[str, float]:
        """Return the search radius as an argument for tools that take one."""
        if self.radius_px is None:
            return {}
        return {"search_radius": self.radius_px * self.reference_transform.a}

    def rasters(self) -> tuple[groundtie.Raster, groundtie.Raster]:
        """Return both images as rasters for the tools."""
        return (
            groundtie.Raster(self.reference, self.reference_transform, self.reference_crs, NODATA),
            groundtie.Raster(self.input, self.input_transform, self.input_crs, NODATA),
        )

    def known(self) -> tuple[FloatArray, FloatArray]:
        """Return corresponding reference and input pixels on a lattice, shapes (n, 2).

        Both images hold data there.
        """
        at = lattice(self.size)
        near = np.rint(at).astype(int)
        shown = self.shown[near[:, 1], near[:, 0]] + (at - near)
        rows, columns = self.reference.shape[1:]
        inside = np.isfinite(shown).all(axis=1) & self.input[:, near[:, 1], near[:, 0]].any(axis=0)
        inside[inside] = (
            (shown[inside] >= 0) & (shown[inside] <= np.array([columns - 1, rows - 1]))
        ).all(axis=1)
        place = np.rint(shown[inside]).astype(int)
        inside[inside] = self.reference[:, place[:, 1], place[:, 0]].any(axis=0)
        return shown[inside], at[inside]

    def errors_px(self, transform: Callable[[FloatArray], FloatArray]) -> tuple[float, float]:
        """Return the 90 % quantile of the errors and their root mean square.

        Parameters
        ----------
        transform
            Input pixels of reference map positions, shapes (n, 2).

        Returns
        -------
        tuple
            In input pixels; infinite where too few positions are known to measure them.
        """
        shown, at = self.known()
        if len(at) < _FEWEST_KNOWN:
            return np.inf, np.inf
        rows, columns = self.reference.shape[1:]
        claimed = self.reference_crs
        crs = None if claimed is None else rasterio.crs.CRS.from_user_input(claimed)
        grid = Grid(self.reference_transform, crs, columns, rows)
        off = np.hypot(*(transform(grid.pixel_to_map(shown)) - at).T)
        return float(np.percentile(off, ERROR_PERCENTILE)), float(np.sqrt(np.mean(off**2)))

    def save(self, folder: Path) -> None:
        """Write r.tif and i.tif into a folder for inspection."""
        folder.mkdir(parents=True, exist_ok=True)
        images = (
            ("r.tif", self.reference, self.reference_transform, self.reference_crs),
            ("i.tif", self.input, self.input_transform, self.input_crs),
        )
        for name, image, transform, crs in images:
            write_image(image, transform, folder / name, crs, NODATA)


def pixels(size: tuple[int, int]) -> FloatArray:
    """Return the (col, row) of each pixel, shape (rows, columns, 2)."""
    return np.stack(np.meshgrid(*(np.arange(side, dtype=float) for side in size)), axis=-1)


def render(source: Source, positions: FloatArray) -> tuple[Image, NDArray[np.bool_]]:
    """Return the input's bands at reference positions of its scene, and where they hold data."""
    at = source.to_input(positions.reshape(-1, 2)).reshape(positions.shape).astype(np.float32)
    rows, columns = source.input.shape[1:]
    inside = ((at >= 0) & (at <= np.array([columns - 1, rows - 1]))).all(axis=-1)
    bands = [
        cv2.remap(band, at[..., 0], at[..., 1], cv2.INTER_LANCZOS4, None, cv2.BORDER_REFLECT_101)
        for band in source.input
    ]
    held = cv2.remap(
        (source.input.any(axis=0) * 255).astype(np.uint8), at[..., 0], at[..., 1], cv2.INTER_LINEAR
    )
    inside &= held == 255
    return np.where(inside, np.clip(np.stack(bands), 1, 255), NODATA).astype(np.uint8), inside


def to_bytes(values: FloatArray) -> Image:
    """Return grey values as bytes, none of them nodata."""
    return np.clip(np.rint(values), 1, 255).astype(np.uint8)


def as_text(shift_px: FloatArray) -> str:
    """Return a shift of the ground as text."""
    return f"ground at ({shift_px[0]:+.1f}, {shift_px[1]:+.1f}) px"


def join(*notes: str) -> str:
    """Join notes into one."""
    return ", ".join(filter(None, notes))


def _keep_nodata(before: Image, after: Image) -> Image:
    return np.where(before.any(axis=0), after, NODATA).astype(np.uint8)
