"""Tools on images that lie on a server: what is registered, and how little of it is read."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rasterio.shutil
from loopback_server import Loopback, serving
from numpy.typing import NDArray
from raster_files import utm_grid, write_raster
from textured_pairs import texture

import groundtie
from groundtie.errors import ParameterError, SameFileError

SIDE, SHIFT_PX = 3072, 16


def image(rows: slice, seed: int) -> NDArray[np.uint16]:
    """Return a texture of 24 to 100 px, of some rows, with noise of its own at each pixel."""
    coarse = texture(SIDE // 8 + 8, SIDE // 8, 1)
    noise = np.random.default_rng(seed).random((rows.stop - rows.start, SIDE), "f4")
    fine = np.kron(coarse.astype("f4"), np.ones((8, 8), "f4"))[rows]
    return (1000 + 150 * fine + 100 * noise).astype(np.uint16)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Loopback]:
    """Serve an item of a catalogue with two assets, of which one is a small raster."""
    write_raster(tmp_path / "input.tif", image(slice(0, 8), 0)[:, :8], utm_grid(8, 8))
    item = {
        "type": "Feature",
        "id": "scene",
        "properties": {"datetime": "2024-05-06T00:00:00Z"},
        "assets": {"visual": {"href": "./input.tif"}, "red": {"href": "red.tif"}},
    }
    (tmp_path / "item.json").write_text(json.dumps(item))
    with serving(tmp_path) as found:
        yield found


@pytest.mark.slow
def test_a_rough_shift_reads_overviews_and_not_the_scene(server: Loopback) -> None:
    for name, first in (("reference", 0), ("input", SHIFT_PX)):
        plain = server.folder / "plain.tif"
        # The input states a place 160 m too far north.
        write_raster(plain, image(slice(first, first + SIDE), first), utm_grid(SIDE, SIDE))
        rasterio.shutil.copy(plain, server.folder / f"{name}.tif", driver="COG", blocksize=256)
    urls = f"{server.url}/reference.tif", f"{server.url}/item.json#visual"
    found = groundtie.coregister(*urls, matching_pixel_size=80.0, search_radius=400.0)
    assert found.transform is not None
    middle = utm_grid(SIDE, SIDE).pixel_to_map([[1500.0, 1500.0]])
    np.testing.assert_allclose(found.transform(middle), [[1500, 1500 - SHIFT_PX]], atol=0.4)
    names = {"reference.tif", "input.tif"}
    for name in names:
        # 1024² pixels, a ninth, show at full resolution whether they are a radar's.
        assert server.sent[name] < 0.2 * (server.folder / name).stat().st_size
    assert {name for _, name in server.requests} == {*names, "item.json"}


def test_an_asset_is_the_file_that_it_names(server: Loopback) -> None:
    with pytest.raises(SameFileError):
        groundtie.coregister(f"{server.url}/input.tif", f"{server.url}/item.json#visual")


def test_an_item_that_is_not_there_is_one_line(server: Loopback) -> None:
    with pytest.raises(ParameterError, match=r"cannot read the STAC file .*404") as caught:
        groundtie.coregister(f"{server.url}/reference.tif", f"{server.url}/none.json#visual")
    assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match="has no asset green"):
        groundtie.coregister(f"{server.url}/reference.tif", f"{server.url}/item.json#green")
