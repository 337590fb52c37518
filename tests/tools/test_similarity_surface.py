from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster
from textured_pairs import TexturedPair, listing, rewritten

from groundtie.cli import main
from groundtie.declaration import tool_of
from groundtie.errors import (
    BandError,
    CancelledError,
    NoOverlapError,
    OutputError,
    ParameterError,
    RasterContentError,
    RasterOpenError,
    SameFileError,
)
from groundtie.progress import Progress
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.description import BORDER_PX
from groundtie.similarity.peak import Peak
from groundtie.similarity.surface import (
    SimilaritySettings,
    describe,
)
from groundtie.similarity.surface import (
    similarity_surface as matching_surface,
)
from groundtie.studies.surface_result import SurfaceResult
from groundtie.studies.window_surface import CHOICES, second_peak
from groundtie.tools.similarity_surface import similarity_surface

# The input claims to lie 70 m east and 45 m south of where it is; pixels are 10 m.
TRUTH_PX = np.array([7.0, 4.5])
QUICK: dict[str, Any] = {"chip_size": 61, "search_radius": 100.0, "sample": 500, "workers": 2}


def like_contrast(pair: TexturedPair, folder: Path) -> TexturedPair:
    """The pair with the input's contrast turned round: correlation needs that of the reference."""
    return rewritten(pair, folder, input=lambda values: 5000 - np.minimum(values, 4999))


def surface_of(pair: TexturedPair, folder: Path, **values: Any) -> SurfaceResult:
    return similarity_surface(
        pair.reference, pair.input, folder / "surface.tif", **{**QUICK, **values}
    )


@pytest.mark.slow
@pytest.mark.parametrize("similarity", CHOICES)
def test_every_measure_finds_the_shift(
    similarity: str, textured: TexturedPair, tmp_path: Path
) -> None:
    pair = like_contrast(textured, tmp_path) if similarity == "ncc" else textured
    result = surface_of(pair, tmp_path, similarity=similarity)
    assert result.values.shape == result.deviations.shape == (21, 21)
    error = np.array(result.peak.shift_px) - TRUTH_PX
    # A sample of 500 pixels of the 3721 is noisier.
    assert np.abs(error).max() < (1.5 if similarity == "mlmi" else 0.5)
    assert not result.peak.at_border
    assert result.peak.height > 4
    # Values are highest where the deviations are: the trend is slow.
    best = np.array(np.unravel_index(np.nanargmax(result.values), (21, 21)))[::-1] - 10
    assert np.abs(best - TRUTH_PX).max() <= (2 if similarity == "mlmi" else 1)
    assert result.second_ratio is None or 0 < result.second_ratio < 1


def test_all_measures_can_be_chosen() -> None:
    assert set(CHOICES) >= {"fused", "nmi", "mi", "renyi", "tsallis", "cluster-reward"}
    assert set(CHOICES) >= {"correlation-ratio", "mlmi", "orientation", "ncc"}
    assert len(set(CHOICES)) == len(CHOICES)


@pytest.mark.slow
@pytest.mark.parametrize(
    "more",
    [
        {"similarity": "renyi", "entropy_order": 0.5},
        {"similarity": "tsallis", "entropy_order": 0.7},
        {"bins": 64, "binning": "linear"},
        {"bins": 256, "chip_size": 41, "search_radius": 80.0},
        {"gpve_order": 2},
        {"gpve_order": 7, "binning": "linear"},
        {"matching_pixel_size": 20.0, "search_radius": 160.0},
    ],
)
def test_parameters_of_the_measures(
    more: dict[str, Any], textured: TexturedPair, tmp_path: Path
) -> None:
    result = surface_of(textured, tmp_path, **{"similarity": "nmi", **more})
    truth = TRUTH_PX * 10 / more.get("matching_pixel_size", 10)
    np.testing.assert_allclose(result.peak.shift_px, truth, atol=0.8)
    plain = surface_of(textured, tmp_path, similarity=more.get("similarity", "nmi"))
    assert plain.values.shape != result.values.shape or (plain.values != result.values).any()


@pytest.mark.parametrize("order", [-100, 100])
def test_an_order_of_which_single_precision_holds_nothing(
    textured: TexturedPair, tmp_path: Path, order: float
) -> None:
    """The surface was flat, and its peak in a corner."""
    with pytest.raises(ParameterError, match="beyond single precision: take an order nearer to 1"):
        similarity_surface(
            textured.reference,
            textured.input,
            tmp_path / "surface.tif",
            similarity="tsallis",
            entropy_order=order,
        )
    assert not listing(tmp_path)


def test_all_grey_values(textured: TexturedPair, tmp_path: Path) -> None:
    """About a hundred of them in each image: as many bins and more take none together."""
    coarser = rewritten(
        textured, tmp_path, reference=lambda v: v // 15 * 15, input=lambda v: v // 22 * 22
    )
    own = {"similarity": "nmi", "chip_size": 51}
    every = surface_of(coarser, tmp_path, binning="grey-values", **own)
    np.testing.assert_allclose(every.peak.shift_px, TRUTH_PX, atol=0.8)
    fewer = surface_of(coarser, tmp_path, bins=32, **own)
    # The more cells, the more is shared by chance, at shifts that share nothing.
    assert np.median(every.values) > np.median(fewer.values)


@pytest.mark.parametrize("similarity", ["fused", "nmi", "orientation", "ncc"])
def test_deviations_are_those_of_matching(
    similarity: str, textured: TexturedPair, tmp_path: Path
) -> None:
    """The tool shows what `coregister` sees of a chip."""
    result = surface_of(textured, tmp_path, similarity=similarity)
    settings = SimilaritySettings(similarity)
    with textured.opened() as pair:
        side = 61 + 2 * (10 + BORDER_PX)
        nominal = pair.nominal_px
        corner = pair.grid.map_to_pixel(result.grid.pixel_to_map([[10, 10]]))[0] - side // 2
        piece = pair.grid.window(*np.rint(corner).astype(int), side, side)
        template, search = (
            describe(patch, 61**2, settings)
            for patch in (pair.reference_patch(piece), pair.input_patch(piece, nominal))
        )
    expected = matching_surface(template.inner(10), search, 10, settings)
    np.testing.assert_allclose(result.deviations, expected, atol=2e-3)


@pytest.mark.slow
def test_files(textured: TexturedPair, tmp_path: Path) -> None:
    picture, numbers = tmp_path / "surface.png", tmp_path / "surface.json"
    result = surface_of(textured, tmp_path, similarity="nmi", picture=picture, numbers=numbers)
    assert set(listing(tmp_path)) == {"surface.tif", "surface.png", "surface.json"}
    with rasterio.open(tmp_path / "surface.tif") as raster:
        assert raster.descriptions == ("nmi", "robust standard deviations")
        assert raster.crs == textured.grid.crs
        np.testing.assert_array_equal(raster.read(1), result.values)
        np.testing.assert_array_equal(raster.read(2), result.deviations)
        assert np.isnan(raster.nodata)
    drawn = cv2.imread(str(picture))
    assert min(drawn.shape[:2]) > 400 and drawn.std() > 10
    written = json.loads(numbers.read_text())
    assert len(written.pop("run")) == 16
    assert written == result.summary()
    peak = result.summary()["peak"]
    assert (peak["right_px"], peak["down_px"]) == result.peak.shift_px
    assert np.linalg.eigvalsh(peak["covariance_px2"]).min() > 0
    assert any(line.startswith("peak: +") for line in result.lines())


def test_the_surface_lies_where_the_windows_centre_would_lie(
    textured: TexturedPair, tmp_path: Path
) -> None:
    x, y = textured.grid.pixel_to_map([[100.0, 90.0]])[0]
    result = surface_of(textured, tmp_path, similarity="nmi", centre_x=x + 3, centre_y=y - 4)
    with rasterio.open(tmp_path / "surface.tif") as raster:
        # Positions within a pixel mean that pixel; rasterio counts from the corner.
        assert raster.xy(10, 10) == pytest.approx((x, y))
        # A shift of 2 px right and 3 px down.
        assert raster.xy(13, 12) == pytest.approx((x + 20, y - 30))
    summary = result.summary()
    assert (summary["window"]["x"], summary["window"]["y"]) == pytest.approx((x, y))
    assert summary["peak"]["x"] == pytest.approx(x + 70, abs=5)
    assert summary["peak"]["y"] == pytest.approx(y - 45, abs=5)


def test_the_default_centre_is_the_middle_of_the_overlap(
    textured: TexturedPair, tmp_path: Path
) -> None:
    """The input is cut to the right half of what it shows."""
    grid = textured.grid
    with rasterio.open(textured.input) as raster:
        values, half = raster.read(1), raster.width // 2
        own = Grid(raster.transform, raster.crs, raster.width, raster.height)
    cut = write_raster(
        tmp_path / "cut.tif", values[:, half:], own.window(half, 0, own.width - half, own.height)
    )
    result = similarity_surface(textured.reference, cut, tmp_path / "s.tif", **QUICK)
    centre = grid.map_to_pixel(result.grid.pixel_to_map([[10, 10]]))[0]
    np.testing.assert_allclose(centre, [half + (grid.width - half) / 2, grid.height / 2], atol=1)
    np.testing.assert_allclose(result.peak.shift_px, TRUTH_PX, atol=0.5)


def test_masked_pixels_and_shifts_without_overlap(textured: TexturedPair, tmp_path: Path) -> None:
    """A mask that leaves the input's upper part: windows shifted far down see too little."""
    shape = textured.reference_values.shape
    kept = np.zeros(shape, np.uint8)
    kept[: shape[0] // 2 + 12] = 1
    mask = write_raster(tmp_path / "mask.tif", kept, textured.grid)
    for similarity in ("nmi", "fused"):
        result = surface_of(
            textured, tmp_path, similarity=similarity, input_mask=mask, search_radius=250.0
        )
        missing = np.isnan(result.values)
        assert missing[-1].all() and not missing[: 25 + 10].any()
        assert (result.deviations[missing] == 0).all()
        assert np.abs(np.array(result.peak.shift_px) - TRUTH_PX).max() < 1.5


def test_images_without_georeferencing(textured: TexturedPair, tmp_path: Path) -> None:
    plain = rewritten(
        textured,
        tmp_path,
        reference=lambda v: (v, {"grid": None}),
        input=lambda v: (v, {"grid": None}),
    )
    result = surface_of(plain, tmp_path, search_radius=10.0, centre_x=110.0, centre_y=100.0)
    np.testing.assert_allclose(result.peak.shift_px, TRUTH_PX, atol=0.5)
    summary = result.summary()
    assert (summary["window"]["x"], summary["window"]["y"]) == (110.0, 100.0)


def test_bands(textured: TexturedPair, tmp_path: Path) -> None:
    noise = np.random.default_rng(3).integers(1, 9000, textured.reference_values.shape)
    both = rewritten(
        textured,
        tmp_path,
        input=lambda v: np.stack([noise.astype(v.dtype), v]),
    )
    found = surface_of(both, tmp_path, similarity="nmi", input_band=2)
    np.testing.assert_allclose(found.peak.shift_px, TRUTH_PX, atol=0.5)
    assert (
        surface_of(both, tmp_path, similarity="nmi", input_band=1).peak.height < found.peak.height
    )
    with pytest.raises(BandError):
        surface_of(both, tmp_path, input_band=3)


def bump(peaks: list[tuple[float, float, float]], radius: int = 12) -> np.ndarray:
    rows, cols = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    total = np.zeros(rows.shape)
    for x, y, height in peaks:
        total += height * np.exp(-((cols - x) ** 2 + (rows - y) ** 2) / 4)
    return total.astype(np.float32)


def peak_at(x: float, y: float, height: float) -> Peak:
    return Peak((x, y), height, np.eye(2), False)


def test_the_second_peak() -> None:
    surface = bump([(3.2, -4.1, 9.0), (-6.3, 5.2, 6.0), (8.0, 8.0, 2.0)])
    second = second_peak(surface, peak_at(3.2, -4.1, 9.0))
    assert second is not None
    np.testing.assert_allclose(second.shift_px, (-6.3, 5.2), atol=0.15)
    assert second.height == pytest.approx(6.0, rel=0.05)
    assert second_peak(bump([(3.2, -4.1, 9.0)]), peak_at(3.2, -4.1, 9.0)) is None
    # What rises towards the border is no peak.
    slope = bump([(0.0, 0.0, 9.0)]) + np.linspace(0, 3, 25, dtype=np.float32)
    assert second_peak(slope, peak_at(0.0, 0.0, 9.0)) is None


def test_a_flank_is_no_second_peak(textured: TexturedPair, tmp_path: Path) -> None:
    result = surface_of(textured, tmp_path, similarity="nmi")
    assert result.second is not None
    away = np.abs(np.array(result.second.shift_px) - result.peak.shift_px)
    assert away.max() > 2
    assert result.second_ratio == pytest.approx(result.second.height / result.peak.height)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_surface(textured: TexturedPair, tmp_path: Path) -> None:
    small = {"similarity": "mlmi", "sample": 100, "search_radius": 30.0}
    runs = [surface_of(textured, tmp_path, seed=seed, **small).values for seed in (1, 1, 2)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert (runs[0] != runs[2]).any()


class TestBadInput:
    @pytest.fixture(autouse=True)
    def _outputs(self, textured: TexturedPair, tmp_path: Path) -> None:
        self.pair, self.folder = textured, tmp_path

    def refused(self, error: type[Exception], message: str, **values: Any) -> None:
        before = listing(self.folder)
        with pytest.raises(error, match=message):
            surface_of(self.pair, self.folder, **values)
        assert listing(self.folder) == before

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ({"centre_x": 500_100.0}, "both x and y"),
            ({"search_radius": 2000.0}, "20 to 1000 m"),
            ({"search_radius": 5.0}, "20 to 1000 m"),
            ({"similarity": "fused", "bins": 256}, "fused takes up to 255 bins"),
            ({"similarity": "fused", "binning": "grey-values"}, "fused takes up to 255 bins"),
            ({"similarity": "nmi", "binning": "grey-values", "bins": 8}, "no number of bins"),
            ({"similarity": "ssd"}, "similarity must be one of"),
            ({"chip_size": 8}, "chip_size must be 16 to 1024"),
            ({"gpve_order": 1}, "gpve_order must be 2 to 7"),
        ],
    )
    def test_parameters(self, values: dict[str, Any], message: str) -> None:
        self.refused(ParameterError, message, **values)

    def test_a_centre_outside_of_the_overlap(self) -> None:
        x, y = self.pair.grid.pixel_to_map([[-20.0, 50.0]])[0]
        self.refused(NoOverlapError, "does not lie in the overlap", centre_x=x, centre_y=y)

    def test_files_that_are_missing_or_the_same(self) -> None:
        output = self.folder / "s.tif"
        with pytest.raises(RasterOpenError):
            similarity_surface(self.pair.reference, self.folder / "no.tif", output)
        with pytest.raises(SameFileError):
            similarity_surface(self.pair.reference, self.pair.reference, output)
        with pytest.raises(OutputError):
            similarity_surface(self.pair.reference, self.pair.input, self.folder / "no" / "s.tif")
        assert not listing(self.folder)

    @pytest.mark.parametrize("which", ["reference", "input"])
    def test_nothing_to_match(self, which: str) -> None:
        def constant(values: np.ndarray) -> np.ndarray:
            return np.full_like(values, 7)

        def empty(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
            return np.zeros_like(values), {"nodata": 0}

        for changed, message in ((constant, "is constant"), (empty, "too few valid pixels")):
            folder = self.folder / changed.__name__
            folder.mkdir()
            pair = rewritten(self.pair, folder, **{which: changed})
            with pytest.raises(RasterContentError, match=f"{which}.*{message}"):
                surface_of(pair, self.folder)
        assert not list(self.folder.glob("*.tif"))

    @pytest.mark.parametrize("fraction", [0.0, 0.5, 0.9])
    def test_cancelled(self, fraction: float) -> None:
        reached = 0.0

        def report(done: float, message: str) -> None:
            nonlocal reached
            reached = max(reached, done)

        progress = Progress(report, lambda: reached >= fraction)
        self.refused(CancelledError, "cancelled", similarity="nmi", progress=progress)

    def test_on_the_command_line(self, capsys: pytest.CaptureFixture[str]) -> None:
        names = [str(self.pair.reference), str(self.pair.input), str(self.folder / "s.tif")]
        called = ["similarity-surface", *names, "--chip-size", "61", "--search-radius"]
        assert main([*called, "3000"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
        assert not listing(self.folder)
        assert main([*called, "100", "--similarity", "nmi", "--json"]) == 0
        summary = json.loads(capsys.readouterr().out)
        assert summary["peak"]["right_px"] == pytest.approx(TRUTH_PX[0], abs=0.5)
        tool = tool_of(similarity_surface)
        assert tool.outputs[0].value(summary) == summary["peak"]["right_px"]


def test_different_pixel_sizes(tmp_path: Path) -> None:
    """The matching grid has the coarser image's pixels; the surface's are as large."""
    rng = np.random.default_rng(5)
    fine = cv2.GaussianBlur(rng.normal(size=(400, 400)), (0, 0), 4.0)
    fine = (100 + 50 * fine / fine.std()).astype(np.float32)
    coarse = np.roll(fine, (20, -30), (0, 1)).reshape(200, 2, 200, 2).mean(axis=(1, 3))
    reference = write_raster(tmp_path / "fine.tif", fine, utm_grid(400, 400, 5.0))
    other = write_raster(tmp_path / "coarse.tif", coarse, utm_grid(200, 200, 10.0))
    result = similarity_surface(
        reference, other, tmp_path / "s.tif", chip_size=60, search_radius=200.0
    )
    np.testing.assert_allclose(result.peak.shift_px, (-15, 10), atol=0.3)
    assert result.grid.pixel_size == (10.0, 10.0)
    assert result.chip_px == 61
    with open_raster(reference) as first, open_raster(other) as second:
        lattice = make_pair(Image(first), Image(second)).grid
    offset = lattice.map_to_pixel(result.grid.pixel_to_map([[0.0, 0.0]]))
    np.testing.assert_allclose(offset, np.rint(offset), atol=1e-6)
