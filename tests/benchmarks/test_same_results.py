"""Two revisions compared: what counts as the same, and what is kept of the base."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from benchmark_cases import SIZES, to_input

from benchmarks import same_results, same_runs
from benchmarks.accuracy import lattice
from benchmarks.cases import RealCase, image_size
from benchmarks.same_results import Comparison, Kept, report
from benchmarks.same_runs import (
    ACCEPTED,
    FAILED,
    REFUSED,
    PairRegistration,
    Prepared,
    Record,
    registrations,
    run_in,
)

TREE = Path(same_results.__file__).parents[1]
POSITIONS = np.array([[1.0, 2.0], [0.1, math.nan]])


def record(verdict: str = ACCEPTED, by: float = 0.0, **more: object) -> Record:
    positions = POSITIONS + by if verdict == ACCEPTED else None
    values = {"name": "coregister a", "inputs": "1", "reason": verdict, "seconds": 1.0}
    return Record(**{**values, "verdict": verdict, "positions": positions, **more})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("base", "now", "same"),
    [
        (record(), record(by=1e-7), True),
        (record(), record(by=1e-5), False),
        (record(), record(positions=np.array([[1.0, 2.0], [0.1, 3.0]])), False),
        (record(), record(REFUSED), False),
        (record(REFUSED), record(REFUSED, reason="another"), True),
        (record(REFUSED), record(FAILED), False),
    ],
)
def test_verdicts_and_transforms_are_compared_but_not_words(
    base: Record, now: Record, same: bool
) -> None:
    assert Comparison(base, now).is_same(1e-6) == same


def test_the_report_shows_what_differs() -> None:
    changed = Comparison(record(), record(REFUSED, reason="layover"))
    text = report([changed, Comparison(record(), record(by=2e-7))], 1e-6)
    assert "| accepted → refused | – | **no** | accepted → layover |" in text
    assert "| accepted | 2.8e-07 | yes | accepted |" in text
    assert "1 of 2 the same" in text


def test_results_are_kept_to_the_last_bit(tmp_path: Path) -> None:
    path = tmp_path / "results" / "base.json"
    kept = Kept(path, "abc")
    kept.add(record(by=1 / 3))
    kept.add(record(REFUSED, name="coregister b"))
    again = Kept(path, "abc")
    found = again.get("coregister a")
    assert found is not None
    np.testing.assert_array_equal(found.positions, POSITIONS + 1 / 3)
    assert again.get("coregister b") == record(REFUSED, name="coregister b")
    assert again.get("coregister c") is None
    with pytest.raises(SystemExit, match="abc"):
        Kept(path, "abd")


class Words:
    """A registration of given words that puts the first lattice position at (1, 2)."""

    name = "words"

    def __init__(self, *words: str) -> None:
        self.words: Sequence[str] = words

    def prepare(self, folder: Path) -> Prepared:
        return Prepared(self.words, (), lambda: POSITIONS)


@pytest.mark.slow
def test_what_cannot_run_has_failed_and_its_last_words_are_kept() -> None:
    found = run_in(TREE, Words("coregister", "no.tif", "no2.tif", "out.tif"))
    assert found.verdict == FAILED
    assert found.positions is None
    assert "no.tif" in found.reason


def test_known_results_are_taken_only_for_the_same_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    known = run_in(TREE, Words("no-such-tool"))
    monkeypatch.setattr(same_runs.subprocess, "run", None)
    assert run_in(TREE, Words("no-such-tool"), known) is known
    with pytest.raises(TypeError):
        run_in(TREE, Words("another"), known)


def test_a_pair_is_located_where_its_transform_puts_it(
    cases: dict[str, RealCase], tmp_path: Path
) -> None:
    """The true transform of a pair that is written with a wrong shift is that of its case."""
    from groundtie.geometry.models import shift_model
    from groundtie.geometry.transform import Transform
    from groundtie.rasters.reading import open_raster

    prepared = PairRegistration("coregister", cases["hills"]).prepare(tmp_path)
    with open_raster(tmp_path / "input.tif") as source:
        nominal = Transform(shift_model(0.0, 0.0), source.grid.crs, source.grid)
    (tmp_path / "transform.json").write_text(json.dumps(nominal.to_json()))
    found = prepared.positions()
    px = lattice(image_size(cases["hills"].reference))
    assert len(found) == len(px)
    # But for the shift that the georeferencing is wrong by, the same all over the image.
    off = found - to_input(px)
    np.testing.assert_allclose(off, np.tile(off[0], (len(off), 1)), atol=1e-6)
    assert 0 < np.hypot(*off[0]) < 2 * max(SIZES["input"])
    assert prepared.words[0] == "coregister"
    assert "--search-radius" in prepared.words


def test_images_as_they_are_have_no_search_radius(
    cases: dict[str, RealCase], tmp_path: Path
) -> None:
    prepared = PairRegistration("estimate-rotation", cases["hills"], False).prepare(tmp_path)
    assert list(prepared.words) == [
        "estimate-rotation",
        *map(str, prepared.inputs),
        *("--transform", str(tmp_path / "transform.json")),
    ]
    assert prepared.inputs == (cases["hills"].reference, cases["hills"].input)


def test_every_pair_is_registered_by_what_fits_it(data: Path) -> None:
    names = [one.name for one in registrations(data)]
    assert len(set(names)) == len(names)
    assert [name for name in names if not name.startswith("refine-rpc")] == [
        "coregister hills",
        "coregister plain",
        "coregister turned",
        "match-optical plain",
        "estimate-rotation turned, as it is",
    ]


def test_the_command_compares_and_keeps(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts = {"base": record(), "now": record(by=1.0)}
    runs: list[str] = []

    def run(tree: Path, registration: Words, known: Record | None = None) -> Record:
        side = "now" if tree == TREE else "base"
        if known is None:
            runs.append(side)
        return known or Record(**{**vars(verdicts[side]), "name": registration.name})

    monkeypatch.setattr(same_runs, "run_in", run)
    monkeypatch.setattr(same_runs, "registrations", lambda data: [Words()])
    monkeypatch.setattr(same_results, "check_package", lambda tree: None)
    monkeypatch.setattr(same_results, "checked_out", lambda revision: nullcontext(tmp_path))
    monkeypatch.setattr(same_results, "_git", lambda *words: "abc")
    options = ["--base", "main", "--base-results", str(tmp_path / "base.json")]
    assert same_results.main([*options, "--base-only"]) == 0
    assert same_results.main(options) == 1
    assert runs == ["base", "now"]
    assert "0 of 1 the same" in capsys.readouterr().out
    assert same_results.main([*options, "--tolerance", "2"]) == 0
    with pytest.raises(SystemExit, match="no registration"):
        same_results.main([*options, "--only", "x*"])


@pytest.mark.skipif(not (TREE / ".git").exists(), reason="not a repository")
def test_a_revision_is_checked_out_and_gone_afterwards() -> None:
    with same_results.checked_out("HEAD") as tree:
        assert (tree / "algorithms" / "groundtie" / "__init__.py").exists()
        same_results.check_package(tree)
    assert not tree.exists()
    with pytest.raises(SystemExit):
        same_results.check_package(tree.parent)


def test_help_needs_nothing() -> None:
    script = Path(same_results.__file__)
    done = subprocess.run([sys.executable, "-I", script, "--help"], check=True, capture_output=True)
    assert b"--base-results" in done.stdout
