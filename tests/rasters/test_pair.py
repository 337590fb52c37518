from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, utm_grid, wave_image, waves, write_raster
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from scipy.ndimage import binary_erosion

from groundtie.errors import (
    BandError,
    GeoreferencingError,
    NoOverlapError,
    ParameterError,
    SameFileError,
)
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, compose, reproject
from groundtie.rasters.pair import Image, ImagePair, coarser_m, make_pair
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import RasterSource, open_raster

LENGTH_M = 700.0
GRID = utm_grid(120, 100)
GEOGRAPHIC = CRS.from_epsg(4326)
NEXT_ZONE = CRS.from_epsg(32633)


class Files:
    """Writes rasters and opens them."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder, self.stack, self.count = folder, stack, 0

    def open(self, values: np.ndarray, grid: Grid | None = GRID, **more: Any) -> RasterSource:
        self.count += 1
        path = write_raster(self.folder / f"image{self.count}.tif", values, grid, **more)
        return self.stack.enter_context(open_raster(path))

    def image(self, grid: Grid = GRID, **more: Any) -> Image:
        """Return an image of waves as its grid says, in UTM."""
        cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
        xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
        xy = xy if grid.crs is None else reproject(xy, grid.crs, UTM)
        values = waves(xy, LENGTH_M).reshape(grid.height, grid.width).astype(np.float32)
        return Image(self.open(values, grid if grid.is_georeferenced else None, **more))


@pytest.fixture
def files(tmp_path: Path) -> Any:
    with ExitStack() as stack:
        yield Files(tmp_path, stack)


def covering(crs: CRS, size: float) -> Grid:
    outline = reproject(GRID.pixel_to_map(GRID.outline()), UTM, crs)
    low, high = outline.min(axis=0), outline.max(axis=0)
    width, height = np.ceil((high - low) / size).astype(int)
    return Grid(Affine(size, 0, low[0], 0, -size, high[1]), crs, int(width), int(height))


def both(pair: ImagePair) -> tuple[Patch, Patch]:
    return pair.reference_patch(pair.grid), pair.input_patch(pair.grid, pair.nominal_px)


def interior(reference: Patch, input: Patch) -> np.ndarray:
    """Tell which pixels both show, without those at a border, where interpolation is coarser."""
    return binary_erosion(reference.valid & input.valid, iterations=2, border_value=1)


def assert_both_show_the_same(pair: ImagePair, share: float = 0.9, tolerance: float = 1.0) -> None:
    """Read on the matching grid, images of the same field are the same."""
    reference, input = both(pair)
    assert reference.values.shape == (pair.grid.height, pair.grid.width)
    common = interior(reference, input)
    assert common.mean() > share
    expected = wave_image(pair.grid, LENGTH_M)
    for patch in (reference, input):
        np.testing.assert_allclose(patch.values[common], expected[common], atol=tolerance)


def test_images_on_one_grid(files: Files) -> None:
    pair = make_pair(files.image(), files.image())
    assert pair.grid == GRID
    assert pair.overlap_px == (120, 100)
    assert_both_show_the_same(pair, 0.99, 1e-3)
    assert pair.notes() == []


@pytest.mark.parametrize(
    "grid",
    [
        covering(GEOGRAPHIC, 10 / 111_195),
        covering(NEXT_ZONE, 10.0),
        utm_grid(60, 50, 20.0),
        utm_grid(240, 200, 5.0),
        Grid(compose(GRID.transform, Affine.rotation(20)), UTM, 150, 120),
    ],
    ids=["degrees", "next zone", "coarser", "finer", "rotated"],
)
@pytest.mark.parametrize("other_way", [False, True])
def test_images_on_different_grids(files: Files, grid: Grid, other_way: bool) -> None:
    images = files.image(), files.image(grid)
    pair = make_pair(*(images[::-1] if other_way else images))
    assert pair.grid.crs == (grid.crs if other_way else UTM)
    coarser = max(image.source.grid.pixel_size_m for image in images)
    assert pair.grid.pixel_size_m == pytest.approx(coarser, rel=0.03)
    if pair.grid.crs == UTM:
        assert_both_show_the_same(pair, 0.5 if grid.transform.b else 0.9)
    else:
        reference, input = both(pair)
        common = interior(reference, input)
        assert common.mean() > 0.8
        np.testing.assert_allclose(reference.values[common], input.values[common], atol=1.0)


@pytest.mark.parametrize("grid", [GRID, covering(GEOGRAPHIC, 10 / 111_195), utm_grid(60, 50, 20.0)])
def test_a_pair_with_exchanged_roles_is_searched_as_far(files: Files, grid: Grid) -> None:
    pair = make_pair(files.image(), files.image(grid), None, 70.0, 10.0, 1.2)
    exchanged = pair.exchanged()
    assert (exchanged.reference, exchanged.input) == (pair.input, pair.reference)
    assert exchanged.limits == pair.limits
    assert exchanged.grid.crs == grid.crs
    assert exchanged.grid.pixel_size_m == pytest.approx(pair.grid.pixel_size_m, rel=0.03)


def test_the_grid_is_cut_to_what_may_overlap_and_keeps_the_references_lattice(
    files: Files,
) -> None:
    """The input covers columns 30-89 and rows 20-69; the search reaches 15 px further."""
    part = GRID.window(30, 20, 60, 50)
    pair = make_pair(files.image(), files.image(part), search_radius_m=150.0)
    assert pair.overlap_px == (60, 50)
    assert pair.grid == GRID.window(15, 5, 90, 80)
    # By default the search reaches 200 m, beyond the reference's border.
    assert make_pair(files.image(), files.image(part)).grid == GRID.window(10, 0, 100, 90)


@pytest.mark.parametrize(("largest_deg", "scale"), [(0.0, 1.2), (90.0, 1.0), (180.0, 1.4)])
def test_the_grid_holds_all_that_a_rotated_image_may_show(
    files: Files, largest_deg: float, scale: float
) -> None:
    """Without georeferencing images have one centre."""
    values = [np.arange(w * h, dtype=np.float32).reshape(h, w) for w, h in ((200, 160), (60, 40))]
    images = [Image(files.open(image, None)) for image in values]
    pair = make_pair(*images, search_radius_m=5.0, rotation_deg=largest_deg, scale=scale)
    assert pair.overlap_px == (60, 40)
    # Rotated by all angles up to the largest, the corners reach so far.
    angle = np.radians(np.arange(0, largest_deg + 1e-9))
    half = [30 * np.cos(angle) + 20 * np.sin(angle), 30 * np.sin(angle) + 20 * np.cos(angle)]
    right, down = (scale * np.abs(reach).max() + 5 for reach in half)
    first = pair.grid.pixel_to_map([[0, 0]])[0]
    last = pair.grid.pixel_to_map([[pair.grid.width - 1, pair.grid.height - 1]])[0]
    np.testing.assert_allclose(first, [99.5 - right, 79.5 - down], atol=1.1)
    np.testing.assert_allclose(last, [99.5 + right, 79.5 + down], atol=1.1)


@pytest.mark.parametrize("rotation_deg", [0.0, 180.0])
def test_the_surroundings_hold_where_what_is_matched_may_nominally_lie(
    files: Files, rotation_deg: float
) -> None:
    larger = GRID.window(-300, -200, 700, 600)
    pair = make_pair(files.image(GRID), files.image(larger), None, 250.0, rotation_deg)
    low, high = pair.grid.map_to_pixel(
        pair.surroundings.pixel_to_map(
            [[0, 0], [pair.surroundings.width - 1, pair.surroundings.height - 1]]
        )
    )
    reach = 250.0 / GRID.pixel_size_m
    assert (low <= -reach).all()
    assert (high >= [119 + reach, 99 + reach]).all()
    # What is rotated may show the reference with any of its pixels.
    own = pair.grid.map_to_pixel(larger.pixel_to_map([[0, 0], [699, 599]]))
    assert ((low <= own[0]) & (high >= own[1])).all() == (rotation_deg > 0)


def test_a_pixel_size_that_is_asked_for(files: Files) -> None:
    pair = make_pair(files.image(), files.image(), matching_pixel_size_m=25.0)
    assert pair.grid.pixel_size_m == pytest.approx(25)
    assert (pair.grid.width, pair.grid.height) == (48, 40)
    assert pair.overlap_px == (48, 40)


def test_a_pixel_size_between_those_of_both_images(files: Files) -> None:
    fine, coarse = files.image(), files.image(covering(UTM, 20.0))
    pair = make_pair(fine, coarse, matching_pixel_size_m=10.0)
    assert pair.overlap_px == (120, 100)
    with pytest.raises(ParameterError, match=r"of 9 is finer than both images' \(10\)"):
        make_pair(fine, coarse, matching_pixel_size_m=9.0)


@pytest.mark.parametrize(
    ("epsg", "pixel", "sides_m"),
    [
        # At 60° north, a metre of Web Mercator is 0.50 m, and a degree 55.8 by 111.4 km.
        (3857, 20.0, (10.0, 10.0)),
        (4326, 1e-4, (7.07, 14.13)),
    ],
)
def test_metres_are_those_where_the_images_overlap(
    files: Files, epsg: int, pixel: float, sides_m: tuple[float, float]
) -> None:
    """The scale at the centre of a map of the world, which is the equator, is another one."""
    size = 4e7 if epsg == 3857 else 360.0
    count = int(size / pixel)
    place = Affine(pixel, 0, -size / 2, 0, -pixel, size / 2 if epsg == 3857 else size / 4)
    world = Grid(place, CRS.from_epsg(epsg), count, count if epsg == 3857 else count // 2)
    part = Grid(Affine(10, 0, 450_000, 0, -10, 6_660_000), NEXT_ZONE, 500, 400)
    input = files.image(part)
    source = files.open(np.ones((4, 4), np.uint8))
    pair = make_pair(Image(replace(source, grid=world)), input, search_radius_m=500.0)
    assert pair.grid.pixel_sides_m == pytest.approx(sides_m, rel=0.01)
    assert pair.limits.radius == 500.0
    for margin, side in zip(
        np.subtract(pair.grid.size, pair.overlap_px) / 2, pair.grid.pixel_sides_m, strict=True
    ):
        assert margin * side >= 500.0 - side
    assert coarser_m(part, world) == coarser_m(world, part) == pytest.approx(10.0, rel=0.01)


def test_a_radius_in_metres_is_kept_along_both_axes_of_degrees(files: Files) -> None:
    """At 60° north pixels of 0.0001° are 5.6 m wide and 11.1 m high."""
    grid = Grid(Affine(1e-4, 0, 9, 0, -1e-4, 60.005), GEOGRAPHIC, 120, 100)
    part = grid.window(30, 30, 60, 40)
    pair = make_pair(files.image(grid), files.image(part), search_radius_m=55.0)
    assert pair.grid == grid.window(20, 20, 80, 60)


def test_images_without_georeferencing_are_matched_in_pixels(files: Files) -> None:
    plain = Grid(PIXEL_COORDINATES, None, 120, 100)
    values = wave_image(GRID, LENGTH_M).astype(np.float32)
    pair = make_pair(Image(files.open(values, None)), Image(files.open(values[5:, 7:], None)))
    assert pair.grid == plain.window(0, 0, 120, 100)
    assert pair.overlap_px == (113, 95)
    np.testing.assert_allclose(pair.nominal_px(np.array([[3.0, 4.0]])), [[3, 4]])
    reference, input = both(pair)
    np.testing.assert_array_equal(reference.values, values)
    np.testing.assert_array_equal(input.values[:95, :113], values[5:, 7:])
    assert not input.valid[96:].any()


def test_local_coordinates_without_crs(files: Files) -> None:
    local = Grid(GRID.transform, None, 120, 100)
    values = wave_image(GRID, LENGTH_M).astype(np.float32)
    pair = make_pair(Image(files.open(values, local)), Image(files.open(values, local)))
    assert pair.grid == local


@pytest.mark.parametrize(
    ("grid", "text"),
    [
        (None, "has no georeferencing"),
        (Grid(GRID.transform, None, 120, 100), "has no CRS"),
    ],
)
@pytest.mark.parametrize("other_way", [False, True])
def test_georeferencing_of_one_only_is_an_error(
    files: Files, grid: Grid | None, text: str, other_way: bool
) -> None:
    values = np.ones((100, 120), np.uint8)
    images = Image(files.open(values)), Image(files.open(values, grid))
    with pytest.raises(GeoreferencingError, match=rf"image2\.tif {text}, but .*image1\.tif has"):
        make_pair(*(images[::-1] if other_way else images))


@pytest.mark.parametrize(
    "grid",
    [
        GRID.shifted(1e5, 0),
        GRID.shifted(0, 1000.0),
        covering(GEOGRAPHIC, 1e-4).shifted(90, -80),
        covering(NEXT_ZONE, 10.0).shifted(0, 5e5),
    ],
)
def test_images_that_do_not_overlap(files: Files, grid: Grid) -> None:
    with pytest.raises(NoOverlapError, match=r"image1\.tif and .*image2\.tif do not overlap"):
        make_pair(files.image(), files.image(grid))


def test_the_same_file_under_two_names(files: Files, tmp_path: Path) -> None:
    image = files.image()
    (tmp_path / "link.tif").symlink_to(image.source.path)
    for name in (image.source.path, str(tmp_path / "link.tif"), str(tmp_path / "." / "image1.tif")):
        with open_raster(name) as again, pytest.raises(SameFileError, match="same raster"):
            make_pair(image, Image(again))


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16", "float32", "float64"])
def test_data_types(files: Files, dtype: str) -> None:
    values = wave_image(GRID, LENGTH_M)
    pair = make_pair(files.image(), Image(files.open(values.astype(dtype))))
    assert_both_show_the_same(pair, 0.9, 1.1)


def test_complex_images_are_read_as_amplitudes_and_said_to_be(files: Files) -> None:
    values = wave_image(GRID, LENGTH_M)
    turned = values * np.exp(1j * np.random.default_rng(0).uniform(0, 6, values.shape))
    pair = make_pair(Image(files.open(turned.astype(np.complex64))), files.image())
    assert_both_show_the_same(pair, 0.9, 1e-2)
    (note,) = pair.notes()
    assert "image1.tif" in note
    assert "amplitude" in note


def test_all_bands_of_an_image(files: Files) -> None:
    values = np.random.default_rng(0).uniform(1, 99, (4, 100, 120)).astype(np.float32)
    image = Image(files.open(values, photometric="RGB", alpha="yes"), band=2)
    found = image.bands_onto(GRID, GRID.map_to_pixel)
    np.testing.assert_allclose(found, values[:3])


def test_bands(files: Files) -> None:
    values = wave_image(GRID, LENGTH_M)
    source = files.open(np.stack([values - 40, values, values + 10]).astype(np.float32))
    for band, offset in ((None, -10), (1, -40), (3, 10)):
        pair = make_pair(files.image(), Image(source, band))
        _, input = both(pair)
        np.testing.assert_allclose(input.values, values + offset, atol=1e-3)
    with pytest.raises(BandError, match="no band 4"):
        both(make_pair(files.image(), Image(source, 4)))


def holed(values: np.ndarray, hole: float) -> np.ndarray:
    values = values.copy()
    values[20:40, 30:60] = hole
    return values


def invalid_variants(files: Files) -> dict[str, RasterSource]:
    values = wave_image(GRID, LENGTH_M).astype(np.float32)
    shown = np.ones(values.shape, np.float32)
    gray_alpha = [ColorInterp.gray, ColorInterp.alpha]
    return {
        "nodata": files.open(holed(values, -9999), nodata=-9999),
        "NaN": files.open(holed(values, np.nan)),
        "infinity": files.open(holed(values, np.inf)),
        "alpha": files.open(np.stack([values, holed(shown, 0)]), colorinterp=gray_alpha),
        "mask band": files.open(values, mask=holed(shown, 0) > 0),
    }


@pytest.mark.parametrize("kind", ["nodata", "NaN", "infinity", "alpha", "mask band"])
@pytest.mark.parametrize("which", ["reference", "input"])
def test_invalid_pixels_take_no_part(files: Files, kind: str, which: str) -> None:
    source = invalid_variants(files)[kind]
    images = {"reference": files.image(), "input": files.image()} | {which: Image(source)}
    patch = dict(zip(("reference", "input"), both(make_pair(**images)), strict=True))[which]
    hole = np.zeros(patch.valid.shape, bool)
    hole[20:40, 30:60] = True
    np.testing.assert_array_equal(patch.valid, ~hole)
    expected = wave_image(GRID, LENGTH_M)
    np.testing.assert_allclose(patch.values[~hole], expected[~hole], atol=1e-3)
    assert np.isfinite(patch.values).all()


@pytest.mark.parametrize("which", ["reference", "input"])
@pytest.mark.parametrize(
    "grid", [GRID, utm_grid(60, 50, 20.0), covering(NEXT_ZONE, 10.0)], ids=["own", "coarse", "crs"]
)
def test_mask_rasters_lie_on_the_map(files: Files, which: str, grid: Grid) -> None:
    """A mask of any grid hides the ground at x below 500 400 m, wherever the pixels are."""
    cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
    xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    easting = reproject(xy, grid.crs, UTM)[:, 0].reshape(grid.height, grid.width)
    mask = files.open((easting > 500_400).astype(np.uint8), grid)
    images = {"reference": files.image(), "input": files.image()}
    images[which] = Image(images[which].source, None, mask)
    patch = dict(zip(("reference", "input"), both(make_pair(**images)), strict=True))[which]
    # Nearest neighbours: to half a pixel of the mask, and where it covers the image.
    assert not patch.valid[:, :38].any()
    assert patch.valid[3:-3, 42:-3].all()


@pytest.mark.parametrize("which", ["reference", "input"])
@pytest.mark.parametrize("phase", [0, 1, 2])
def test_what_a_mask_hides_takes_no_part_however_narrow(
    files: Files, which: str, phase: int
) -> None:
    """Matching pixels of 3 × 3: every one of the left half has hidden columns, none elsewhere."""
    keeps = np.ones((99, 120), np.uint8)
    keeps[:, :60][:, np.arange(60) % 3 != phase] = 0
    mask = files.open(keeps, utm_grid(120, 99))
    images = {"reference": files.image(), "input": files.image()}
    images[which] = Image(images[which].source, None, mask)
    pair = make_pair(**images, matching_pixel_size_m=30.0)
    patch = dict(zip(("reference", "input"), both(pair), strict=True))[which]
    assert patch.valid.shape[1] == 40
    assert not patch.valid[:, :20].any()
    assert patch.valid[1:-1, 21:-1].all()
    # On a coarser level the centre decides: what takes part here must not vanish there.
    coarse = pair.grid.scaled(4)
    level = (
        pair.reference_patch(coarse)
        if which == "reference"
        else pair.input_patch(coarse, pair.nominal_px)
    )
    assert not level.valid[:, :5].any()
    assert level.valid[1:-1, 6:-1].all()


def test_a_mask_goes_with_the_input_where_it_is_moved(files: Files) -> None:
    hidden = np.ones((100, 120), np.uint8)
    hidden[:, :40] = 0
    pair = make_pair(
        files.image(), Image(files.image().source, None, files.open(hidden, nodata=255))
    )
    patch = pair.input_patch(pair.grid, lambda xy: pair.nominal_px(xy) + [10, 0])
    assert not patch.valid[:, :30].any()
    assert patch.valid[:, 31:109].all()


def test_patches_of_windows_are_parts_of_the_whole(files: Files) -> None:
    pair = make_pair(files.image(), files.image(covering(NEXT_ZONE, 10.0)))
    piece = pair.grid.window(30, 20, 41, 37)
    for part, whole in zip(
        (pair.reference_patch(piece), pair.input_patch(piece, pair.nominal_px)),
        both(pair),
        strict=True,
    ):
        np.testing.assert_allclose(part.values, whole.values[20:57, 30:71], atol=0.2)
    beyond = pair.reference_patch(pair.grid.window(-10, -10, 20, 20))
    assert beyond.valid.sum() == 100


def test_undeclared_areas_of_zeros_take_no_part_and_single_zeros_do(files: Files) -> None:
    values = wave_image(GRID, LENGTH_M).astype(np.float32)
    values[:, :40] = 0
    values[60, 80] = 0
    source = files.open(values)
    patch = make_pair(Image(source), files.image()).reference_patch(GRID)
    assert not patch.valid[:, :42].any()
    assert patch.valid[:, 43:].all()
    # A nodata value says that zeros are data.
    declared = files.open(values, nodata=-1)
    assert make_pair(Image(declared), files.image()).reference_patch(GRID).all_valid


def test_what_is_hidden_tells_nothing_of_empty_areas_either(files: Files) -> None:
    values = wave_image(GRID, LENGTH_M).astype(np.float32)
    hidden = np.zeros(values.shape, bool)
    hidden[20:60, 30:80] = True
    emptied = np.where(hidden, 0, values).astype(np.float32)
    seen, blind = (
        make_pair(Image(files.open(image)), files.image()).reference_patch(GRID, hidden)
        for image in (values, emptied)
    )
    np.testing.assert_array_equal(seen.valid, ~hidden)
    np.testing.assert_array_equal(blind.valid, seen.valid)
    np.testing.assert_array_equal(blind.values, seen.values)


def test_a_narrow_border_of_zeros_is_empty_and_the_images_own_border_is_not(files: Files) -> None:
    values = wave_image(GRID, LENGTH_M).astype(np.float32)
    values[:4] = 0
    pair = make_pair(Image(files.open(values)), files.image())
    around = pair.reference_patch(GRID.window(-10, -10, 140, 120))
    assert not around.valid[10:16, 10:130].any()
    assert around.valid[17:110, 10:130].all()


def test_an_image_that_the_references_map_has_no_place_for(files: Files) -> None:
    """A quarter turn from a zone's middle, on the equator, its map ends."""
    away = Grid(Affine(1e-4, 0, 98.997, 0, -1e-4, 0.003), GEOGRAPHIC, 60, 60)
    values = np.arange(3600, dtype=np.float32).reshape(60, 60)
    message = r"image2\.tif \(in EPSG:4326\) has no position .* of .*image1\.tif \(EPSG:32632\)$"
    with pytest.raises(NoOverlapError, match=message):
        make_pair(files.image(), Image(files.open(values, away)))


@pytest.mark.parametrize("asked_m", [500.0, 1e5, 1e9])
def test_nothing_is_searched_where_the_images_cannot_overlap(files: Files, asked_m: float) -> None:
    pair = make_pair(files.image(), files.image(GRID.shifted(200, 0)), search_radius_m=asked_m)
    # The far corners are 1200 m + 200 m, and 1000 m apart; pixels have 10 m.
    farthest = float(np.hypot(1400, 1000))
    assert pair.limits.radius == pytest.approx(min(asked_m, farthest), abs=15)
    whole = make_pair(files.image(), files.image(GRID.shifted(200, 0)), search_radius_m=farthest)
    if asked_m > farthest:
        assert (pair.grid, pair.surroundings) == (whole.grid, whole.surroundings)


def test_an_image_is_rotated_on_the_ground_whatever_the_shape_of_pixels(files: Files) -> None:
    """At 60° north, pixels of degrees are twice as high as wide."""
    grid = Grid(Affine(1e-4, 0, 10.0, 0, -1e-4, 60.02), GEOGRAPHIC, 400, 400)
    part = grid.window(150, 150, 100, 100)
    images = [
        Image(files.open(np.arange(of.width * of.height, dtype=np.float32).reshape(of.size), of))
        for of in (grid, part)
    ]
    pair = make_pair(*images, search_radius_m=5.0, rotation_deg=90.0)
    width_m, height_m = grid.pixel_sides_m
    diagonal_m = np.hypot(100 * width_m, 100 * height_m)
    assert pair.grid.width * width_m == pytest.approx(diagonal_m + 10, abs=3 * width_m)
    assert pair.grid.height * height_m == pytest.approx(diagonal_m + 10, abs=3 * height_m)
