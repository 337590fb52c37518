"""Rasters that are read over a network: what is asked of the server, and what it may answer."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio.shutil
from loopback_server import Loopback, serving
from numpy.typing import NDArray
from raster_files import utm_grid, wave_image, write_raster

from groundtie.errors import RasterOpenError
from groundtie.rasters.reading import Window, open_raster
from groundtie.rasters.remote import reason_of_server
from groundtie.rasters.rendered import SUN, Light, rendered

SIDE = 2048


@pytest.fixture(scope="module")
def image() -> NDArray[np.uint8]:
    return np.random.default_rng(3).integers(1, 255, (SIDE, SIDE)).astype(np.uint8)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loopback]:
    with serving(tmp_path_factory.mktemp("served")) as found:
        yield found


def cog(path: Path, image: NDArray[Any], how: str) -> Path:
    plain = write_raster(path.with_suffix(".plain.tif"), image, utm_grid(*image.shape[::-1]))
    rasterio.shutil.copy(plain, path, driver="COG", overview_resampling=how, blocksize=256)
    plain.unlink()
    return path


@pytest.fixture(scope="module")
def averaged(server: Loopback, image: NDArray[np.uint8]) -> Path:
    return cog(server.folder / "average.tif", image, "average")


def test_a_window_of_a_remote_raster_is_that_of_the_file(
    server: Loopback, averaged: Path, image: NDArray[np.uint8]
) -> None:
    with open_raster(server.of(averaged)) as remote:
        values, valid = remote.read(Window(300, 500, 200, 100))
    np.testing.assert_array_equal(values, image[500:600, 300:500])
    assert valid.all()
    # Two blocks and the header, not 4 MB; nothing that may lie beside it was asked for.
    assert server.sent["average.tif"] < 300_000
    assert {name for _, name in server.requests} == {"average.tif"}


def test_a_reduced_image_is_read_from_overviews(
    server: Loopback, averaged: Path, image: NDArray[np.uint8]
) -> None:
    server.sent.clear()
    with open_raster(f"{server.of(averaged)}?reduced") as remote:
        values, valid = remote.read(remote.window, None, (SIDE // 8, SIDE // 8))
    means = image.reshape(SIDE // 8, 8, SIDE // 8, 8).mean(axis=(1, 3))
    # Three overviews are rounded to whole numbers, each to ± 0.5.
    assert np.abs(values - means).max() < 1.5
    assert valid.all()
    assert server.sent["average.tif"] < 0.2 * averaged.stat().st_size


@pytest.mark.parametrize("heights_first", [True, False])
@pytest.mark.slow
def test_what_is_rendered_of_heights_is_not_taken_for_heights(
    server: Loopback, averaged: Path, heights_first: bool
) -> None:
    shape, light = (SIDE // 8, SIDE // 8), Light(SUN, 135.0)
    with open_raster(f"{server.of(averaged)}?{heights_first}") as remote:
        sources = [remote, rendered(remote, light)]
        order = (0, 1) if heights_first else (1, 0)
        found = {i: sources[i].read(remote.window, None, shape)[0] for i in order}
    with open_raster(averaged) as local:
        expected, _ = rendered(local, light).read(local.window, None, shape)
    assert found[0].mean() > 100
    np.testing.assert_array_equal(found[1], expected)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1024, 1024), (1037, 1101)])
def test_larger_pixels_lie_where_they_do_without_overviews(
    server: Loopback, size: tuple[int, int]
) -> None:
    grid = utm_grid(*size)
    noise = np.random.default_rng(1).normal(size=size[::-1])
    # Noise shows how overviews were made.
    path = cog(
        server.folder / f"waves{size[0]}.tif", wave_image(grid, 5_000) + noise / 8, "average"
    )
    window, shape = Window(101, 203, 900, 800), (80, 90)
    with open_raster(server.of(path)) as remote, open_raster(path) as local:
        found, _ = remote.read(window, None, shape)
        expected, _ = local.read(window, None, shape)
    # Waves of 500 px and amplitude 30 are damped a little more, by (pi / 500)² / 6 · (8² - 1) = 0.4
    # %; half a pixel of the overview aside, 4 px, they would differ by 1.5.
    assert np.abs(found - expected).max() < 0.4
    assert server.sent[path.name] < 0.6 * path.stat().st_size


@pytest.mark.parametrize("how", ["nearest", "mode"])
def test_overviews_of_picked_pixels_are_not_read(
    server: Loopback, image: NDArray[np.uint8], how: str
) -> None:
    path = cog(server.folder / f"{how}.tif", image[:512, :512], how)
    with open_raster(server.of(path)) as remote:
        values, _ = remote.read(remote.window, None, (64, 64))
    means = image[:512, :512].reshape(64, 8, 64, 8).mean(axis=(1, 3))
    np.testing.assert_allclose(values, means, atol=1e-3)


def test_a_file_that_is_not_there(server: Loopback) -> None:
    with pytest.raises(RasterOpenError, match="there is no such file on the server") as caught:
        open_raster(f"{server.url}/none.tif")
    assert "\n" not in str(caught.value)


def test_a_server_that_is_away() -> None:
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        port = nobody.getsockname()[1]
    with pytest.raises(RasterOpenError, match="the server does not answer") as caught:
        open_raster(f"http://127.0.0.1:{port}/a.tif")
    assert f"127.0.0.1:{port}/a.tif" in str(caught.value)


@pytest.mark.slow
def test_a_server_that_goes_away_while_pixels_are_read(
    tmp_path: Path, image: NDArray[np.uint8]
) -> None:
    path = cog(tmp_path / "a.tif", image, "average")
    with serving(tmp_path) as server:
        remote = open_raster(server.of(path))
    with remote, pytest.raises(RasterOpenError, match="sends its pixels no more"):
        remote.read(Window(1500, 1500, 200, 200))


@pytest.mark.parametrize(
    ("answer", "expected"),
    [
        ("band 1: IReadBlock failed", "sends its pixels no more"),
        ("HTTP response code: 404", "no such file"),
    ],
)
def test_numbers_in_names_are_no_answers(answer: str, expected: str) -> None:
    name = "/vsicurl/http://127.0.0.1:40449/tile_403.tif"
    assert expected in reason_of_server(f"{name}, {answer}", name)


def test_what_is_no_raster(server: Loopback) -> None:
    (server.folder / "page.tif").write_text("<html>")
    with pytest.raises(RasterOpenError, match="supported file format"):
        open_raster(f"{server.url}/page.tif")
