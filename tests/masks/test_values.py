"""Values of masks: numbers, ranges, and what missions mean by theirs."""

from __future__ import annotations

import numpy as np
import pytest

from groundtie.errors import ParameterError
from groundtie.masks.values import SCHEMES, mask_values


def excluded(text: str, values: list[float]) -> list[float]:
    array = np.array(values, np.float32)
    return array[mask_values(text).excluded(array)].tolist()


def test_numbers_and_ranges() -> None:
    assert excluded("3,8-10", list(range(13))) == [3, 8, 9, 10]
    assert excluded(" 0 , 5 - 5 ", [0, 1, 5]) == [0, 5]


def test_whole_numbers_are_told_apart_as_far_as_single_precision_does() -> None:
    assert excluded("16777215", [16_777_214, 16_777_215, 16_777_216]) == [16_777_215]


def test_what_is_no_number_takes_no_part() -> None:
    values = np.array([np.nan, np.inf, 1.0])
    np.testing.assert_array_equal(mask_values("3").excluded(values), [True, True, False])


# What the missions' documents call the values (see docs/references.md).
SENTINEL_2 = {
    **{0: "no data", 1: "saturated", 3: "cloud shadow", 8: "cloud", 9: "cloud", 10: "cirrus"},
    **{2: "", 4: "", 5: "", 6: "", 7: "", 11: ""},
}
# Examples of USGS's guide: clear land, clear water, cloud, cloud shadow, cirrus, fill, snow.
LANDSAT = {1: "fill", 22280: "cloud", 23888: "shadow", 55052: "cloud", 54596: "cirrus"} | {
    **{21824: "", 21952: "", 30048: ""}
}
FMASK = {0: "", 1: "", 2: "shadow", 3: "", 4: "cloud", 255: "fill"}
HLS = {0b10: "cloud", 0b100: "adjacent", 0b1000: "shadow", 0b10000: "", 0b100000: "", 255: "fill"}
HLS |= {0b11000000: "", 0b11000010: "cloud"}


@pytest.mark.parametrize(
    ("scheme", "meanings"),
    [("scl", SENTINEL_2), ("qa-pixel", LANDSAT), ("fmask", FMASK), ("hls-fmask", HLS)],
)
def test_schemes_leave_out_clouds_shadows_and_fill(scheme: str, meanings: dict[int, str]) -> None:
    values = sorted(meanings)
    assert excluded(scheme, values) == [value for value in values if meanings[value]]


def test_what_planet_does_not_call_clear_is_left_out() -> None:
    assert excluded("UDM2", [0, 1]) == [0]


def test_names_may_be_written_either_way() -> None:
    assert mask_values("QA_PIXEL") is SCHEMES["qa-pixel"]


@pytest.mark.parametrize(
    "text", ["", "clouds", "3;4", "-3", "10-8", "1.5", "3,", "9" * 10, "16777216", "1-16777217"]
)
def test_other_words_are_an_error(text: str) -> None:
    with pytest.raises(
        ParameterError, match="must be numbers up to 16777215 and ranges, as 3,8-10, or one of"
    ):
        mask_values(text)
