"""Content that two images share: one ground, a copy, or something drawn."""

from __future__ import annotations

from dataclasses import replace

import pytest

from groundtie.matching.shared_content import Sensors, SharedContent
from groundtie.similarity.in_common import VIEW_SHARPNESS, Sameness

# Shares that agree in one sensor's views; they grow with coarser pixels.
ONE_GROUND = Sameness(sharpness=1.5, area=0.4, reduced_area=0.7, coarse_area=0.8, ground=0.4)


@pytest.mark.parametrize(
    ("ground", "related", "is_ground"), [(0.3, 0.0, True), (0.0, 0.3, True), (0.1, 0.1, False)]
)
def test_ground_varies_alike_or_follows_in_other_colours(
    ground: float, related: float, is_ground: bool
) -> None:
    """The latter as in a negative, in which nothing varies alike."""
    assert Sameness(1.0, 0.1, 0.2, 0.3, ground, related).varies_as_ground == is_ground


@pytest.mark.parametrize(("coarse", "is_view"), [(0.66, True), (0.6, False)])
def test_views_are_a_little_less_alike_in_coarser_pixels(coarse: float, is_view: bool) -> None:
    """Illumination and seasons differ over wide areas, but not for two radar images."""
    sameness = replace(ONE_GROUND, coarse_area=coarse)
    assert SharedContent(sameness, Sensors.CAMERAS).is_explained == is_view
    assert sameness.is_finer_than_ground and not sameness.varies_as_ground


@pytest.mark.parametrize("sensors", Sensors)
def test_what_varies_alike_in_two_radar_images_is_no_ground(sensors: Sensors) -> None:
    """Each radar image has independent speckle."""
    assert SharedContent(ONE_GROUND, sensors).is_explained == (sensors is Sensors.CAMERAS)


@pytest.mark.parametrize(
    ("shares", "is_evident"),
    [
        ({}, False),
        ({"ground": 0.1}, True),
        ({"coarse_area": 0.6}, True),
        ({"sharpness": 3.0}, True),
        ({"step_width": 0.2}, True),
        ({"ground": 0.1, "related": 0.7}, True),
        ({"area": 0.8}, True),
    ],
)
def test_one_ground_in_pixels_of_many_looks_is_nothing_drawn(
    shares: dict[str, float], is_evident: bool
) -> None:
    """It is if it moves as drawn content, leaves hardly anything else, or is of two sensors."""
    sameness = replace(ONE_GROUND, **shares)
    assert sameness.is_evident
    assert SharedContent(sameness, Sensors.RADARS, off_drawn=1.1).is_evident == is_evident
    assert SharedContent(sameness, Sensors.RADARS, off_drawn=0.9).is_evident
    assert SharedContent(sameness, Sensors.DIFFERENT, off_drawn=1.1).is_evident


def test_edges_sharper_than_those_of_bands_are_no_views_of_one_ground() -> None:
    # As for bands of one exposure.
    views = replace(ONE_GROUND, sharpness=4.2)
    assert views.is_view
    assert not replace(views, sharpness=VIEW_SHARPNESS).is_view
    copy = replace(views, area=0.8, reduced_area=0.8, sharpness=VIEW_SHARPNESS)
    assert copy.is_copy and copy.has_sharp_edges
    assert not replace(copy, sharpness=0.9 * VIEW_SHARPNESS).has_sharp_edges


@pytest.mark.parametrize(
    ("sharpness", "related", "is_drawn"), [(2.8, 0.0, False), (3.0, 0.0, True), (3.0, 0.8, False)]
)
def test_sharp_edges_are_drawn_but_those_of_copies_in_other_colours(
    sharpness: float, related: float, is_drawn: bool
) -> None:
    sameness = replace(ONE_GROUND, sharpness=sharpness, related=related, ground=0.0)
    assert SharedContent(sameness, Sensors.CAMERAS).is_drawn == is_drawn


@pytest.mark.parametrize(
    ("ground", "beside", "off_drawn", "is_explained", "is_drawn"),
    [
        (0.20, 0.0, 0.9, False, True),
        (0.20, 0.0, 1.1, True, False),
        (0.20, 1.5, 1.1, True, True),
        (0.12, 0.0, 1.1, False, True),
    ],
)
def test_views_that_move_as_ground_may_have_sharp_edges_and_leave_little(
    ground: float, beside: float, off_drawn: float, is_explained: bool, is_drawn: bool
) -> None:
    sameness = replace(ONE_GROUND, sharpness=8.0, ground=ground, beside=beside)
    shared = SharedContent(sameness, Sensors.CAMERAS, off_drawn=off_drawn)
    assert shared.is_explained == is_explained and shared.is_drawn == is_drawn
    assert shared.may_hide_ground == (not is_explained)


@pytest.mark.parametrize(
    ("sensors", "area", "ground", "off_drawn", "may_be_drawn"),
    [
        (Sensors.CAMERAS, 0.1, 0.2, 0.9, True),
        (Sensors.CAMERAS, 0.1, 0.4, 0.9, False),
        (Sensors.CAMERAS, 0.1, 0.2, 1.1, False),
        (Sensors.CAMERAS, 0.1, 0.1, 1.1, True),
        (Sensors.CAMERAS, 0.4, 0.2, 0.9, False),
        (Sensors.DIFFERENT, 0.1, 0.4, 1.1, True),
    ],
)
def test_what_is_the_same_may_be_drawn_unless_it_is_evident_or_a_view(
    sensors: Sensors, area: float, ground: float, off_drawn: float, may_be_drawn: bool
) -> None:
    sameness = replace(ONE_GROUND, area=area, ground=ground)
    assert SharedContent(sameness, sensors, off_drawn=off_drawn).may_be_drawn == may_be_drawn


def test_copies_may_hide_ground_wherever_they_lie() -> None:
    """A part of the other image may be another place, of which copies leave little."""
    copy = Sameness(sharpness=8.0, area=0.8, reduced_area=0.8, coarse_area=0.8, ground=0.2)
    shared = SharedContent(copy, Sensors.CAMERAS, off_drawn=1.1)
    assert copy.is_copy and shared.is_explained and shared.may_hide_ground
    assert not replace(shared, sameness=replace(copy, coarse_area=0.7)).may_hide_ground


def test_edges_to_one_side_are_drawn_however_alike_the_rest_is() -> None:
    assert SharedContent(replace(ONE_GROUND, beside=1.1), Sensors.CAMERAS).is_drawn
    assert not SharedContent(replace(ONE_GROUND, beside=0.9), Sensors.CAMERAS).is_drawn


@pytest.mark.parametrize(("ground", "is_exact"), [(0.2, True), (0.3, False)])
def test_radar_images_of_one_ground_lie_near_whole_pixels_by_chance(
    ground: float, is_exact: bool
) -> None:
    shared = SharedContent(replace(ONE_GROUND, ground=ground), Sensors.RADARS, is_whole=True)
    assert shared.is_exact == is_exact
    assert replace(shared, sensors=Sensors.CAMERAS).is_exact
    assert not replace(shared, is_whole=False).is_exact


@pytest.mark.parametrize(
    ("reduced", "coarse", "is_of_cameras"),
    [(0.24, 0.33, True), (0.14, 0.12, False), (0.25, 0.29, False), (0.4, 0.35, False)],
)
def test_cameras_images_are_alike_in_coarse_pixels(
    reduced: float, coarse: float, is_of_cameras: bool
) -> None:
    """Images of a radar and a camera are not, with or without speckle."""
    sameness = replace(ONE_GROUND, ground=0.1, reduced_area=reduced, coarse_area=coarse)
    assert SharedContent(sameness, Sensors.CAMERAS).is_of_cameras == is_of_cameras
    assert not SharedContent(sameness, Sensors.DIFFERENT).is_of_cameras


@pytest.mark.parametrize(("coarse", "fine", "is_noise"), [(0.1, 0.2, True), (0.3, 0.2, False)])
def test_a_pattern_of_noise_is_drawn_over_radar_images(
    coarse: float, fine: float, is_noise: bool
) -> None:
    """Fine structure of other images may be the more coherent: light and physics are coarse."""
    sameness = replace(ONE_GROUND, area=0.1, coarse_coherence=coarse, fine_coherence=fine)
    shared = SharedContent(sameness, Sensors.RADARS, off_drawn=2.0)
    assert [shared.is_noise, shared.is_drawn, shared.is_evident] == [is_noise] * 3
    for sensors in (Sensors.CAMERAS, Sensors.DIFFERENT):
        assert not SharedContent(sameness, sensors).is_noise
