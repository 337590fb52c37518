"""Sources of pixels: GDAL's handles of a file, an open dataset, or an array."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.env import env_ctx_if_needed

from ..arrays import Raster
from ..errors import RasterOpenError, raised_by
from ..raster_names import identity, is_remote
from .grid import Grid
from .metadata import BandInfo
from .remote import environment, reason_of_server

if TYPE_CHECKING:
    from .reading import RasterSource


class Handles(Protocol):
    """Lends objects with rasterio's `read` and `read_masks`, each to one thread at a time."""

    @property
    def identity(self) -> Hashable:
        """Key that is equal for handles of the same raster."""

    def borrow(self) -> contextlib.AbstractContextManager[Any]:
        """Lend an object; errors while reading with it become `RasterOpenError`."""

    def close(self) -> None:
        """Close everything that was opened here."""


class FileHandles:
    """GDAL's handles of one file: each is used by one thread at a time, as GDAL demands.

    Each handle decompresses blocks for itself, so that threads, whose windows share blocks, take
    turns with one handle: two handles take 1.6 times the processor time, and are no faster. Remote
    files are read by all threads at once.

    Parameters
    ----------
    path
        The file, or GDAL's name.
    overview
        Number of the overview to read, from 0; None: the raster itself.

    Attributes
    ----------
    place
        Name of the file in any working folder.
    identity
        Location of the file, or GDAL's name.
    """

    def __init__(self, path: str, overview: int | None = None) -> None:
        self._path = path
        # By these the file stays the same one if the program changes its working folder.
        self.place = os.path.abspath(path) if os.path.exists(path) else path
        self.identity = identity(path)
        self._options = {} if overview is None else {"overview_level": overview}
        self._lock = threading.Lock()
        self._turn: contextlib.AbstractContextManager[Any] = (
            contextlib.nullcontext() if is_remote(path) else threading.RLock()
        )
        self._free: list[Any] = []

    @contextlib.contextmanager
    def borrow(self) -> Iterator[Any]:
        """Lend a handle to one thread at a time."""
        with self._turn:
            with _reading(self._path, self.place), environment(self._path):
                with self._lock:
                    dataset = self._free.pop() if self._free else None
                dataset = dataset or rasterio.open(self.place, sharing=False, **self._options)
                with env_ctx_if_needed():  # GDAL's messages in this thread go to rasterio's logger
                    yield dataset
            with self._lock:
                self._free.append(dataset)

    def close(self) -> None:
        """Close the file; reading opens it again."""
        with self._lock:
            while self._free:
                self._free.pop().close()


class OpenDataset:
    """A dataset that the caller opened and will close; threads take turns with it."""

    def __init__(self, dataset: Any) -> None:
        self._dataset = dataset
        self._lock = threading.Lock()
        self.identity = identity(dataset.name)

    @contextlib.contextmanager
    def borrow(self) -> Iterator[Any]:
        """Lend the dataset, once no other thread uses it."""
        with _reading(self._dataset.name, self._dataset.name), self._lock:
            if self._dataset.closed:
                raise RasterOpenError(f"the dataset is closed: {self._dataset.name}")
            yield self._dataset

    def close(self) -> None:
        """Leave the dataset as it is."""


class ArrayHandles:
    """An array, read as rasterio reads files; threads need not take turns."""

    def __init__(self, raster: Raster) -> None:
        self._bands = raster.bands
        self.identity = raster.identity

    @contextlib.contextmanager
    def borrow(self) -> Iterator[ArrayHandles]:
        """Lend itself."""
        yield self

    def close(self) -> None:
        """Leave the array as it is."""

    def read(
        self, indexes: Sequence[int] | None = None, *, window: Any, out_dtype: Any = None
    ) -> NDArray[Any]:
        """Return a copy of some bands of a window, by default of all, (bands, h, w)."""
        part = np.ma.getdata(self._bands[(slice(None), *window.toslices())])
        chosen = slice(None) if indexes is None else [index - 1 for index in indexes]
        return np.array(part[chosen], dtype=out_dtype)

    def read_masks(self, index: int, *, window: Any) -> NDArray[np.uint8]:
        """Return 255 where a band of a window is not masked, else 0; shape (h, w)."""
        masked = np.ma.getmaskarray(self._bands[(index - 1, *window.toslices())])
        return np.where(masked, 0, 255).astype(np.uint8)


def read_by(
    source: RasterSource, handles: Handles, band: BandInfo, grid: Grid | None = None
) -> RasterSource:
    """Return a raster of a single band, read by other handles, with its other metadata unchanged.

    The raster's own overviews do not apply to it.
    """
    return replace(
        source,
        grid=grid or source.grid,
        bands=(band,),
        has_mask_band=False,
        has_masks_by_band=False,
        colormap=None,
        _handles=handles,
        _overviews=None,
    )


@contextlib.contextmanager
def _reading(name: str, place: str) -> Iterator[None]:
    try:
        yield
    # Not all errors of rasterio are RasterioErrors: GDAL's own and CRSError are not.
    except UnicodeDecodeError as error:
        raise RasterOpenError(f"cannot read {name}: what it states is no UTF-8") from error
    except Exception as error:
        if not raised_by(error, "rasterio"):
            raise
        reason = str(error.__cause__ or error).replace(place, name).removeprefix(f"{name}: ")
        if is_remote(name):
            reason = reason_of_server(reason, name)
        raise RasterOpenError(f"cannot read {name}: {reason}") from error
