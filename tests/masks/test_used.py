from __future__ import annotations

from groundtie.masks.used import MaskUsed


def test_it_fits_in_a_line() -> None:
    used = MaskUsed("layer", "reference", 0.8, "what roads.gpkg covers")
    assert (
        used.line()
        == "mask of the ground: layer, 80% of the reference take part; what roads.gpkg covers"
    )
    assert (
        MaskUsed("none", None, 1.0, "as asked for").line()
        == "mask of the ground: none, as asked for"
    )
