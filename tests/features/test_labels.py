"""What a vector layer states of classes: which features are left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from raster_files import utm_grid

from groundtie.features.labels import KEPT, LEFT_OUT, layer_labels


@pytest.mark.parametrize(
    ("value", "is_left_out"),
    [(1234567.0, True), (1.0, True), (1, True), ("1", False), ("cloud", True), (2, False)],
)
def test_numbers_are_the_same_however_they_are_written(
    tmp_path: Path, value: object, is_left_out: bool
) -> None:
    """Of text, the letters count."""
    path = tmp_path / "l.geojson"
    point = {"type": "Point", "coordinates": [9.0005, 45.1532]}
    feature = {"type": "Feature", "geometry": point, "properties": {"class": value}}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    found = layer_labels(path, "class", ["1234567", "1.0", "cloud"], utm_grid(10, 10))
    assert found.labels.tolist() == [LEFT_OUT if is_left_out else KEPT]
