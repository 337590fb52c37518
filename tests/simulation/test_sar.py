"""Geometry and statistics of the simulated radar image against theory."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from groundtie.errors import ParameterError
from groundtie.simulation import sar
from groundtie.simulation.cover import Cover
from groundtie.simulation.sar import (
    SarOptions,
    add_speckle,
    quantise_amplitude,
    render_sar,
    sar_power,
)
from groundtie.simulation.scene import Scene, SceneOptions, generate_scenes

GROUND = 10 ** (-20 / 10)
ROOF = 10 ** (-3 / 10)

ROWS, COLUMNS = 80, 300
FOOT, WIDTH = 140, 60
MIDDLE = slice(20, 60)

MakeScene = Callable[..., Scene]


def profile(scene: Scene, options: SarOptions, rows: slice = MIDDLE) -> np.ndarray:
    """Expected power across the middle of a building that is long in azimuth, looking to +x."""
    mean = sar_power(scene, options)[rows].mean(axis=0)
    return mean if options.orbit == "ascending" else mean[::-1]


def first_crossing(values: np.ndarray, level: float, start: int) -> float:
    """Position, linearly interpolated, where values first rise above a level."""
    i = start + int(np.argmax(values[start:] > level))
    return float(i - 1 + (level - values[i - 1]) / (values[i] - values[i - 1]))


@pytest.fixture
def smooth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the texture off, so that single pixels can be compared with theory."""
    monkeypatch.setattr(sar, "_TEXTURE_DB", np.zeros(7, np.float32))
    monkeypatch.setattr(sar, "_PATCH_DB", 0.0)
    monkeypatch.setattr(sar, "_BRIGHT_POINT_SHARE", 0.0)


@pytest.fixture(params=["ascending", "descending"])
def orbit(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def slab(make_scene: MakeScene, orbit: str) -> Callable[[float], Scene]:
    """A building whose near wall stands FOOT pixels from the side where the radar is."""

    def build(height_m: float) -> Scene:
        columns = slice(FOOT, FOOT + WIDTH)
        if orbit == "descending":
            columns = slice(COLUMNS - FOOT - WIDTH, COLUMNS - FOOT)
        return make_scene((ROWS, COLUMNS), ((slice(0, ROWS), columns, height_m),))

    return build


@pytest.mark.usefixtures("smooth")
@pytest.mark.parametrize(("height_m", "incidence_deg"), [(12.0, 35.0), (20.0, 50.0), (9.0, 25.0)])
class TestSlab:
    """A box of height h: layover h / tan θ towards the radar, shadow h · tan θ behind."""

    def test_layover_begins_where_theory_says(
        self, slab: Callable[[float], Scene], orbit: str, height_m: float, incidence_deg: float
    ) -> None:
        power = profile(slab(height_m), SarOptions(incidence_deg, orbit))
        layover = height_m / math.tan(math.radians(incidence_deg))
        wall_edge = FOOT - 0.5
        begin = first_crossing(power, ROOF / 2, 20)
        assert begin == pytest.approx(wall_edge - layover, abs=0.75)

    def test_ground_before_the_layover_is_as_bright_as_without_building(
        self, slab: Callable[[float], Scene], orbit: str, height_m: float, incidence_deg: float
    ) -> None:
        power = profile(slab(height_m), SarOptions(incidence_deg, orbit))
        before = int(FOOT - height_m / math.tan(math.radians(incidence_deg))) - 3
        # The noise floor of −25 dB is added to −20 dB.
        assert power[20:before].mean() == pytest.approx(GROUND + 10**-2.5, rel=1e-3)

    def test_roof_moves_towards_the_radar(
        self, slab: Callable[[float], Scene], orbit: str, height_m: float, incidence_deg: float
    ) -> None:
        power = profile(slab(height_m), SarOptions(incidence_deg, orbit))
        layover = height_m / math.tan(math.radians(incidence_deg))
        far_edge = FOOT - 0.5 + WIDTH - layover
        end = len(power) - 1 - first_crossing(power[::-1], ROOF / 2, COLUMNS - FOOT - WIDTH)
        assert end == pytest.approx(far_edge, abs=0.75)

    def test_shadow_ends_where_theory_says(
        self, slab: Callable[[float], Scene], orbit: str, height_m: float, incidence_deg: float
    ) -> None:
        power = profile(slab(height_m), SarOptions(incidence_deg, orbit))
        shadow = height_m * math.tan(math.radians(incidence_deg))
        end = first_crossing(power, (GROUND + 10**-2.5) / 2, FOOT + WIDTH + 1)
        assert end == pytest.approx(FOOT - 0.5 + WIDTH + shadow, abs=0.75)

    def test_shadow_holds_nothing_but_noise(
        self, slab: Callable[[float], Scene], orbit: str, height_m: float, incidence_deg: float
    ) -> None:
        power = profile(slab(height_m), SarOptions(incidence_deg, orbit))
        shadow = height_m * math.tan(math.radians(incidence_deg))
        inside = power[FOOT + WIDTH + 1 : int(FOOT + WIDTH + shadow) - 1]
        np.testing.assert_allclose(inside, 10**-2.5, rtol=1e-4)

    def test_double_bounce_stands_at_the_foot(
        self, slab: Callable[[float], Scene], orbit: str, height_m: float, incidence_deg: float
    ) -> None:
        power = profile(slab(height_m), SarOptions(incidence_deg, orbit))
        # The foot lies on the border of two pixels.
        assert int(np.argmax(power)) in (FOOT - 1, FOOT)
        assert power.max() > 3 * ROOF


@pytest.mark.usefixtures("smooth")
class TestWalls:
    def test_double_bounce_fades_when_the_wall_turns_away(self, make_scene: MakeScene) -> None:
        options = SarOptions(35.0)
        square = make_scene((ROWS, COLUMNS), ((slice(20, 60), slice(140, 180), 10.0),))
        row, column = np.mgrid[:ROWS, :COLUMNS]
        diamond = make_scene((ROWS, COLUMNS))
        inside = abs(row - 40) + abs(column - 160) < 28
        diamond.object_m[inside] = 10.0
        diamond.parcel[inside] = 1
        straight, turned = (sar_power(s, options) for s in (square, diamond))
        assert np.percentile(straight, 99.9) > 5 * np.percentile(turned, 99.9)

    def test_narrow_building_has_its_corner_too(self, make_scene: MakeScene) -> None:
        narrow = make_scene((ROWS, COLUMNS), ((slice(0, ROWS), slice(140, 142), 8.0),))
        power = profile(narrow, SarOptions(35.0))
        assert int(np.argmax(power)) in (139, 140)
        assert power.max() > 3 * ROOF

    def test_wall_is_even_over_its_layover(self, make_scene: MakeScene) -> None:
        """Storeys differ from row to row; their mean over many rows does not."""
        box = (slice(0, 250), slice(140, 142), 60.0)
        power = profile(make_scene((250, COLUMNS), (box,)), SarOptions(35.0), slice(0, 250))
        layover = 60 / math.tan(math.radians(35))
        wall = power[int(140 - layover) + 4 : 136]
        first, last = wall[: len(wall) // 2].mean(), wall[len(wall) // 2 :].mean()
        assert first == pytest.approx(last, rel=0.1)

    def test_roof_of_a_canopy_has_no_wall(self, make_scene: MakeScene) -> None:
        wood = make_scene((ROWS, COLUMNS), ((slice(0, ROWS), slice(140, 200), 10.0),))
        wood.parcels.cover[1] = Cover.FOREST
        power = profile(wood, SarOptions(35.0))
        assert power.max() < 1.5 * ROOF

    def test_corner_in_another_buildings_shadow_is_dark(self, make_scene: MakeScene) -> None:
        options = SarOptions(45.0)
        front = (slice(0, ROWS), slice(100, 120), 30.0)
        # Its shadow is 30 px long, the next wall stands 10 px behind it.
        hidden = (slice(0, ROWS), slice(130, 150), 8.0)
        both = profile(make_scene((ROWS, COLUMNS), (front, hidden)), options)
        alone = profile(make_scene((ROWS, COLUMNS), (hidden,)), options)
        assert alone[128:132].max() > ROOF
        assert both[128:132].max() < ROOF / 5

    def test_power_of_walls_and_corners_grows_with_height(self, make_scene: MakeScene) -> None:
        def net(height_m: float) -> float:
            box = (slice(0, 250), slice(140, 152), height_m)
            total = [
                profile(make_scene((250, COLUMNS), boxes), SarOptions(35.0), slice(0, 250)).sum()
                for boxes in ((), (box,))
            ]
            return float(total[1] - total[0] - 12 * ROOF)

        # The strengths of single walls are drawn: 250 of them leave 9 % of uncertainty.
        assert net(40) == pytest.approx(4 * net(10), rel=0.25)


@pytest.mark.usefixtures("smooth")
class TestTerrain:
    @pytest.mark.parametrize("slope", [-0.3, -0.1, 0.1, 0.3])
    def test_foreshortening(self, make_scene: MakeScene, slope: float) -> None:
        """On a slope m, range runs by dg = dx · (1 − m / tan θ): power per range by its inverse."""
        options = SarOptions(40.0)
        terrain = np.broadcast_to(slope * np.arange(COLUMNS), (ROWS, COLUMNS))
        power = profile(make_scene((ROWS, COLUMNS), terrain_m=terrain), options)[100:200].mean()
        expected = GROUND / (1 - slope / math.tan(math.radians(40))) + 10**-2.5
        assert power == pytest.approx(expected, rel=0.005)

    def test_slope_away_steeper_than_the_ray_is_in_shadow(self, make_scene: MakeScene) -> None:
        options = SarOptions(60.0)
        x = np.arange(COLUMNS)
        # The ray descends by 1 / tan 60° = 0.58 a pixel, the slope by 0.8.
        fall = np.where(x < 100, 0, np.where(x < 150, -0.8 * (x - 100), -40))
        terrain = np.broadcast_to(fall, (ROWS, COLUMNS))
        power = profile(make_scene((ROWS, COLUMNS), terrain_m=terrain), options)
        np.testing.assert_allclose(power[104:150], 10**-2.5, rtol=1e-3)
        lit_again = 100 + 40 * math.tan(math.radians(60))
        assert power[int(lit_again) + 2 :].mean() > 2 * 10**-2.5

    def test_ground_stays_at_its_place_on_the_map(self, make_scene: MakeScene) -> None:
        """Geocoded with the terrain, the edge of a field does not move with the height."""
        parcel = np.zeros((ROWS, COLUMNS), np.int32)
        parcel[:, 150:] = 2
        x = np.arange(COLUMNS)
        hill = np.broadcast_to(40 * np.exp(-(((x - 130) / 60.0) ** 2)), (ROWS, COLUMNS))
        middle = (0.1 + 0.01) / 2 + 10**-2.5
        edges = [
            first_crossing(profile(scene, SarOptions(35.0)), middle, 120)
            for scene in (
                make_scene((ROWS, COLUMNS), parcel=parcel),
                make_scene((ROWS, COLUMNS), parcel=parcel, terrain_m=hill),
                make_scene((ROWS, COLUMNS), parcel=parcel, terrain_m=hill + 300),
            )
        ]
        assert edges[0] == pytest.approx(149.5, abs=0.3)
        assert edges[1] == pytest.approx(edges[0], abs=0.5)
        assert edges[2] == pytest.approx(edges[1], abs=0.2)

    def test_pixel_size_scales_heights(self, make_scene: MakeScene) -> None:
        options = SarOptions(35.0)
        boxes = [((slice(0, ROWS), slice(FOOT, FOOT + WIDTH), h),) for h in (10.0, 20.0)]
        fine = make_scene((ROWS, COLUMNS), boxes[0])
        coarse = make_scene((ROWS, COLUMNS), boxes[1], pixel_size_m=2.0)
        begins = [first_crossing(profile(s, options), ROOF / 2, 20) for s in (fine, coarse)]
        assert begins[0] == pytest.approx(begins[1], abs=0.3)


class TestStrips:
    def test_no_seam_where_strips_meet(self, make_scene: MakeScene) -> None:
        scene = make_scene((300, 200), ((slice(0, 300), slice(90, 130), 10.0),))
        power = sar_power(scene, SarOptions(35.0))
        above, below = power[200:256].mean(axis=0), power[256:300].mean(axis=0)
        # The texture of roofs varies by 2.5 dB a pixel; the mean over 50 rows by a tenth of that.
        assert np.abs(np.log(above / below)).mean() < 0.15

    def test_margin_is_cut_off_but_seen_from(self, make_scene: MakeScene) -> None:
        """A building in the margin lays over into the image."""
        scene = make_scene((400, 300), ((slice(0, 400), slice(205, 220), 30.0),), margin_px=100)
        power = sar_power(scene, SarOptions(35.0))
        assert power.shape == (200, 100)
        assert power[:, -20:].mean() > 10 * power[:, :40].mean()


class TestSpeckle:
    @pytest.mark.parametrize("looks", [0.8, 1.0, 3.3, 4.0, 16.0])
    def test_equivalent_number_of_looks(self, looks: float) -> None:
        power = np.full((400, 400), 0.3, np.float32)
        speckled = add_speckle(power, looks, np.random.default_rng(1))
        assert speckled.mean() == pytest.approx(0.3, rel=0.02)
        assert (speckled.mean() / speckled.std()) ** 2 == pytest.approx(looks, rel=0.1)

    @pytest.mark.parametrize("looks", [1.0, 4.0])
    def test_image_of_a_homogeneous_area(self, make_scene: MakeScene, looks: float) -> None:
        image = render_sar(make_scene((300, 300)), SarOptions(35.0, looks=looks))
        power = image.astype(float) ** 2
        # Patches of 0.7 dB add to the speckle: remove them by looking at small areas.
        areas = power.reshape(15, 20, 15, 20).swapaxes(1, 2).reshape(225, 400)
        enl = areas.mean(axis=1) ** 2 / areas.var(axis=1)
        assert np.median(enl) == pytest.approx(looks, rel=0.1)

    @pytest.mark.parametrize("looks", [1.0, 3.0])
    def test_amplitude_is_nakagami(self, looks: float) -> None:
        """The root of a gamma variable of mean 1; Rayleigh for one look."""
        options = SarOptions(looks=looks, amplitude_at_0_db=20000)
        power = add_speckle(np.ones((80, 80), np.float32), looks, np.random.default_rng(2))
        amplitude = quantise_amplitude(power, options) / 20000
        assert stats.kstest(amplitude.ravel(), stats.nakagami(looks).cdf).pvalue > 0.01

    def test_speckle_is_white(self) -> None:
        speckle = add_speckle(np.ones((300, 300), np.float32), 1.0, np.random.default_rng(3))
        assert abs(np.corrcoef(speckle[:, 1:].ravel(), speckle[:, :-1].ravel())[0, 1]) < 0.02

    def test_none_with_infinite_looks(self, make_scene: MakeScene) -> None:
        scene = make_scene((60, 60))
        options = SarOptions(looks=math.inf)
        image = render_sar(scene, options)
        assert np.array_equal(image, quantise_amplitude(sar_power(scene, options), options))


class TestGreyValues:
    def test_calibration(self) -> None:
        options = SarOptions(amplitude_at_0_db=2000)
        power = np.array([[1.0, 0.01, 1e-9, 1e9]], np.float32)
        assert quantise_amplitude(power, options).tolist() == [[2000, 200, 1, 65535]]

    def test_type(self, make_scene: MakeScene) -> None:
        assert render_sar(make_scene((40, 40)), SarOptions()).dtype == np.uint16

    def test_heavy_tail_over_a_town(self) -> None:
        image = render_sar(
            generate_scenes(SceneOptions((400, 400), density="urban")).radar, SarOptions()
        )
        # Rayleigh: the 99.9 % quantile is 3.2 times the median.
        assert np.percentile(image, 99.9) > 10 * np.median(image)
        assert image.max() > 20000


class TestReproducible:
    def test_same_seed(self, make_scene: MakeScene) -> None:
        first, second = (render_sar(make_scene((50, 50), seed=3), SarOptions()) for _ in range(2))
        assert np.array_equal(first, second)

    def test_other_seed(self, make_scene: MakeScene) -> None:
        images = (render_sar(make_scene((50, 50), seed=s), SarOptions()) for s in (3, 4))
        assert not np.array_equal(*images)


@pytest.mark.parametrize(
    "wrong",
    [
        {"incidence_deg": 5},
        {"incidence_deg": 80},
        {"orbit": "polar"},
        {"looks": 0},
        {"amplitude_at_0_db": -1},
    ],
    ids=str,
)
def test_refuses_what_cannot_be(wrong: dict) -> None:
    with pytest.raises(ParameterError):
        SarOptions(**wrong)


@pytest.mark.usefixtures("smooth")
class TestWindows:
    """Windows gather a wall's power in a lattice of points and take none away."""

    PITCH_M = 4.0
    ROWS = 250

    def wall(self, make_scene: MakeScene, window_m: float) -> np.ndarray:
        """The layover of a wall 60 m high before its narrow roof, from 250 rows."""
        scene = make_scene((self.ROWS, COLUMNS), ((slice(0, self.ROWS), slice(140, 142), 60.0),))
        scene.parcels.window_m[1] = window_m
        power = sar_power(scene, SarOptions(35.0))
        layover = 60 / math.tan(math.radians(35))
        return power[:, int(140 - layover) + 4 : 136]

    def test_power_is_the_same_on_average(self, make_scene: MakeScene) -> None:
        plain, windowed = (self.wall(make_scene, window_m).mean() for window_m in (0, self.PITCH_M))
        assert windowed == pytest.approx(plain, rel=0.05)

    def test_they_repeat_along_the_wall(self, make_scene: MakeScene) -> None:
        by_row = self.wall(make_scene, self.PITCH_M).mean(axis=1)
        spectrum = np.abs(np.fft.rfft(by_row - by_row.mean()))
        assert np.argmax(spectrum[: self.ROWS // 3]) == round(self.ROWS / self.PITCH_M)
        plain = self.wall(make_scene, 0).mean(axis=1)
        assert by_row.std() > 3 * plain.std()

    def test_they_repeat_with_the_storeys(self, make_scene: MakeScene) -> None:
        """60 m are 20 storeys: 20 rows of points over the layover of 60 / tan 35°."""
        wall = self.wall(make_scene, self.PITCH_M)
        by_range = wall.mean(axis=0)
        spectrum = np.abs(np.fft.rfft(by_range - by_range.mean(), 2048))
        storey = 3 / math.tan(math.radians(35))
        assert np.argmax(spectrum[100:]) + 100 == pytest.approx(2048 / storey, rel=0.03)
