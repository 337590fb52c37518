from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from raster_files import write_raster
from rpc_models import camera_rpc, to_rasterio

from groundtie.errors import CancelledError, OutputError, RasterOpenError
from groundtie.rasters import atomic
from groundtie.rasters.atomic import Outputs, scratch_file, writing


class FakeLibraryError(Exception):
    """One of the classes that rasterio keeps to itself."""

    __module__ = "rasterio._private"


def test_outputs_appear_together_under_their_names(tmp_path: Path) -> None:
    image, table = tmp_path / "image.tif", tmp_path / "table.csv"
    with Outputs() as outputs:
        for final in (image, table):
            staged = outputs.stage(final)
            staged.write_text(final.name)
            assert staged.parent == tmp_path
            assert staged.suffix == final.suffix
            assert staged.name.startswith(".")
        assert not image.exists()
        assert not table.exists()
    assert sorted(os.listdir(tmp_path)) == ["image.tif", "table.csv"]
    assert image.read_text() == "image.tif"
    assert table.read_text() == "table.csv"


@pytest.mark.parametrize(
    "error", [CancelledError("cancelled"), KeyboardInterrupt(), MemoryError(), OSError(28, "full")]
)
def test_nothing_remains_after_an_exception(tmp_path: Path, error: BaseException) -> None:
    def fail() -> None:
        with Outputs() as outputs:
            staged = outputs.stage(tmp_path / "image.tif")
            staged.write_text("half")
            with scratch_file(staged) as scratch:
                scratch.write_text("half")
                raise error

    with pytest.raises(type(error)) as raised:
        fail()
    assert raised.value is error
    assert os.listdir(tmp_path) == []


def test_an_old_file_stays_when_the_job_fails(tmp_path: Path) -> None:
    final = tmp_path / "image.tif"
    final.write_text("old")

    def fail() -> None:
        with Outputs() as outputs:
            outputs.stage(final).write_text("new")
            raise CancelledError("cancelled")

    with pytest.raises(CancelledError):
        fail()
    assert os.listdir(tmp_path) == ["image.tif"]
    assert final.read_text() == "old"


def test_sidecars_of_the_old_file_disappear(tmp_path: Path) -> None:
    """They hold statistics or masks of another file."""
    final = tmp_path / "image.tif"
    for suffix in ("", ".aux.xml", ".ovr", ".msk", "-wal", "-shm", "-journal"):
        (tmp_path / (final.name + suffix)).write_text("old")
    with Outputs() as outputs:
        outputs.stage(final).write_text("new")
    assert os.listdir(tmp_path) == ["image.tif"]
    assert final.read_text() == "new"


@pytest.mark.parametrize("name", ["image_RPC.TXT", "image_rpc.txt", "image.RPB", "image.rpb"])
def test_rpcs_of_an_older_raster_disappear(tmp_path: Path, name: str) -> None:
    """GDAL prefers them to those in the new one's tags."""
    (tmp_path / name).write_text("LINE_OFF: 7")
    rpcs = to_rasterio(camera_rpc())
    with Outputs() as outputs:
        write_raster(outputs.stage(tmp_path / "image.tif"), np.ones((4, 4), np.uint8), rpcs=rpcs)
    with rasterio.open(tmp_path / "image.tif") as dataset:
        assert dataset.rpcs.line_off == rpcs.line_off
    assert os.listdir(tmp_path) == ["image.tif"]


@pytest.mark.parametrize("other", ["image.NTF", "image.jp2", "IMAGE.TIL"])
def test_rpcs_of_another_raster_stay(tmp_path: Path, other: str) -> None:
    for name in (other, "image.RPB"):
        (tmp_path / name).write_text("a vendor's")
    with Outputs() as outputs:
        outputs.stage(tmp_path / "image.tif").write_text("new")
    assert sorted(os.listdir(tmp_path)) == sorted([other, "image.RPB", "image.tif"])


WORLD = "10\n0\n0\n-10\n500005\n5299995\n"
TABLE = """!table
!version 300
Definition Table
  File "image.tif"
  Type "RASTER"
  (500000,5300000) (0,0) Label "1",
  (500040,5300000) (4,0) Label "2",
  (500000,5299960) (0,4) Label "3"
  CoordSys Earth Projection 8, 104, "m", 15, 0, 0.9996, 500000, 0
  Units "m"
"""


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize(
    ("name", "text"),
    [("image.tfw", WORLD), ("IMAGE.TFW", WORLD), ("image.wld", WORLD), ("image.tab", TABLE)],
)
def test_world_files_of_an_older_raster_disappear(tmp_path: Path, name: str, text: str) -> None:
    """GDAL would take them for the georeferencing of one that has none."""
    pixels = np.ones((4, 4), np.uint8)
    write_raster(tmp_path / "image.tif", pixels)
    (tmp_path / name).write_text(text)
    with rasterio.open(tmp_path / "image.tif") as dataset:
        assert dataset.transform.a == 10
    with Outputs() as outputs:
        write_raster(outputs.stage(tmp_path / "image.tif"), pixels)
    with rasterio.open(tmp_path / "image.tif") as dataset:
        assert dataset.transform.is_identity
        assert dataset.crs is None
    assert os.listdir(tmp_path) == ["image.tif"]


@pytest.mark.parametrize("suffix", [".csv", ".vrt", ".png"])
def test_world_files_are_removed_for_geotiffs_alone(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "image.wld").write_text(WORLD)
    with Outputs() as outputs:
        outputs.stage(tmp_path / f"image{suffix}").write_text("new")
    assert sorted(os.listdir(tmp_path)) == sorted(["image.wld", f"image{suffix}"])


@pytest.mark.parametrize(
    "other", ["image.png", "IMAGE.JPG", "image.tiff", "image.pgm", "image.dwg", "image"]
)
def test_world_files_of_another_raster_stay(tmp_path: Path, other: str) -> None:
    for name in (other, "image.wld"):
        (tmp_path / name).write_text(WORLD)
    with Outputs() as outputs:
        outputs.stage(tmp_path / "image.tif").write_text("new")
    assert sorted(os.listdir(tmp_path)) == sorted([other, "image.tif", "image.wld"])


def test_the_table_of_another_raster_stays(tmp_path: Path) -> None:
    table = '!table\nDefinition Table\n File "b.jpg"\n Type "RASTER"\n'
    (tmp_path / "image.tab").write_text(table)
    with Outputs() as outputs:
        outputs.stage(tmp_path / "image.tif").write_text("new")
    assert (tmp_path / "image.tab").exists()


def test_what_is_withdrawn_is_not_written_and_the_others_are(tmp_path: Path) -> None:
    with Outputs() as outputs:
        for name in "ab":
            outputs.stage(tmp_path / name).write_text("new")
        outputs.withdraw(tmp_path / "a")
    assert os.listdir(tmp_path) == ["b"]


def test_the_table_of_a_vector_layer_stays(tmp_path: Path) -> None:
    (tmp_path / "image.tab").write_text(TABLE.replace('"RASTER"', "NATIVE Charset"))
    with Outputs() as outputs:
        outputs.stage(tmp_path / "image.tif").write_text("new")
    assert sorted(os.listdir(tmp_path)) == ["image.tab", "image.tif"]


def test_rpcs_are_removed_for_rasters_alone(tmp_path: Path) -> None:
    for name in ("image_RPC.TXT", "other.RPB"):
        (tmp_path / name).write_text("old")
    with Outputs() as outputs:
        outputs.stage(tmp_path / "image.csv").write_text("a table")
        outputs.stage(tmp_path / "other.tif").write_text("a raster")
        outputs.stage(tmp_path / "other.RPB").write_text("its RPCs")
    assert sorted(os.listdir(tmp_path)) == ["image.csv", "image_RPC.TXT", "other.RPB", "other.tif"]
    assert (tmp_path / "other.RPB").read_text() == "its RPCs"


def test_neighbours_with_alike_names_are_left_alone(tmp_path: Path) -> None:
    for name in ("image.tif.txt", "image.tiff", "image.png"):
        (tmp_path / name).write_text(name)
    with Outputs() as outputs:
        outputs.stage(tmp_path / "image.tif").write_text("new")
    assert len(os.listdir(tmp_path)) == 4


def test_sidecars_go_along(tmp_path: Path) -> None:
    final, beside = tmp_path / "image.tif", tmp_path / "image.tif.aux.xml"
    beside.write_text("old")
    with Outputs() as outputs:
        staged = outputs.stage(final)
        staged.write_text("new")
        staged.with_name(staged.name + ".aux.xml").write_text("new")
    assert sorted(os.listdir(tmp_path)) == [final.name, beside.name]
    assert beside.read_text() == "new"


class Refusal:
    """Stands for `os.replace` where one file is open in another program."""

    def __init__(self, refused: Path) -> None:
        self._refused, self._replace = refused, os.replace

    def __call__(self, source: Path, target: Path) -> None:
        if target == self._refused and "-new" in source.name:
            raise PermissionError(13, f"{target.name} is open in another program")
        self._replace(source, target)


@pytest.mark.parametrize("new", [False, True])
def test_all_is_as_before_if_a_file_cannot_be_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, new: bool
) -> None:
    finals = [tmp_path / name for name in ("a.tif", "b.csv")]
    before = (
        {} if new else {"a.tif": "old", "a.tif.msk": "old mask", "a.RPB": "old", "b.csv": "old"}
    )
    for name, text in before.items():
        (tmp_path / name).write_text(text)

    def work() -> None:
        with Outputs() as outputs:
            for final in finals:
                outputs.stage(final).write_text("new")
            monkeypatch.setattr(atomic.os, "replace", Refusal(finals[1]))

    with pytest.raises(OutputError, match=r"b\.csv: b\.csv is open"):
        work()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("fails", [False, True])
def test_a_disk_without_second_names_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    """What was replaced there cannot be undone; each name still has a whole file."""

    def no_link(source: Path, target: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    finals = [tmp_path / name for name in ("a.tif", "b.csv")]
    for final in finals:
        final.write_text("old")
    monkeypatch.setattr(atomic.os, "link", no_link)
    expected = pytest.raises(OutputError) if fails else contextlib.nullcontext()
    with expected, Outputs() as outputs:
        for final in finals:
            outputs.stage(final).write_text("new")
        if fails:
            monkeypatch.setattr(atomic.os, "replace", Refusal(finals[1]))
    assert [final.read_text() for final in finals] == ["new", "old" if fails else "new"]
    assert sorted(os.listdir(tmp_path)) == ["a.tif", "b.csv"]


def test_no_final_name_is_ever_missing_and_the_order_is_that_of_staging(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ["points.csv", "image.tif", "report.html"]
    for name in names:
        (tmp_path / name).write_text("old")
    seen: list[str] = []

    def watched(change: Callable[..., None]) -> Callable[..., None]:
        def changed(*args: Any, **more: Any) -> None:
            change(*args, **more)
            seen.append("".join((tmp_path / name).read_text()[0] for name in names))

        return changed

    with Outputs() as outputs:
        for name in names:
            outputs.stage(tmp_path / name).write_text("new")
        for name in ("replace", "link", "unlink", "rename"):
            monkeypatch.setattr(atomic.os, name, watched(getattr(os, name)))
    assert list(dict.fromkeys(seen)) == ["ooo", "noo", "nno", "nnn"]


def test_all_files_are_on_the_disk_before_the_first_gets_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    fsync, replace = os.fsync, os.replace

    def flushed(descriptor: int) -> None:
        fsync(descriptor)
        done.append("flush")

    def placed(source: Path, target: Path) -> None:
        replace(source, target)
        done.append(Path(target).name)

    with Outputs() as outputs:
        for name in ("a.tif", "b.csv"):
            outputs.stage(tmp_path / name).write_text("new")
        monkeypatch.setattr(atomic.os, "fsync", flushed)
        monkeypatch.setattr(atomic.os, "replace", placed)
    # The folder comes last: it holds the names.
    assert done == ["flush", "flush", "a.tif", "b.csv", "flush"]


def test_a_file_that_does_not_get_onto_the_disk_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Disks of a network may tell only then that they are full."""
    (tmp_path / "a.tif").write_text("old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    def work() -> None:
        with Outputs() as outputs:
            outputs.stage(tmp_path / "a.tif").write_text("new")
            monkeypatch.setattr(atomic.os, "fsync", full)

    with pytest.raises(OutputError, match="no space left on"):
        work()
    assert os.listdir(tmp_path) == ["a.tif"]
    assert (tmp_path / "a.tif").read_text() == "old"


def test_names_may_be_as_long_as_the_system_allows(tmp_path: Path) -> None:
    names = ["ä" * 120 + ".tif", "a" * 250 + ".csv"]
    with Outputs() as outputs:
        for name in names:
            outputs.stage(tmp_path / name).write_text("new")
    assert sorted(os.listdir(tmp_path)) == sorted(names)


def test_a_name_that_is_too_long_is_an_error(tmp_path: Path) -> None:
    with Outputs() as outputs, pytest.raises(OutputError, match=r"cannot write .*too long"):
        outputs.stage(tmp_path / ("x" * 256))


def test_an_output_that_was_never_written_is_an_error(tmp_path: Path) -> None:
    def work() -> None:
        with Outputs() as outputs:
            outputs.stage(tmp_path / "a.csv").write_text("written")
            outputs.stage(tmp_path / "b.csv")

    with pytest.raises(OutputError, match=r"not written.*b\.csv"):
        work()
    assert os.listdir(tmp_path) == []


def test_impossible_names_are_refused_at_once(tmp_path: Path) -> None:
    with Outputs() as outputs:
        with pytest.raises(OutputError, match="is a folder"):
            outputs.stage(tmp_path)
        with pytest.raises(OutputError, match="does not exist"):
            outputs.stage(tmp_path / "missing" / "a.tif")
        outputs.stage(tmp_path / "a.tif").write_text("")
        with pytest.raises(OutputError, match="twice"):
            outputs.stage(f"{tmp_path}/../{tmp_path.name}/a.tif")


def test_relative_names_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with Outputs() as outputs:
        outputs.stage("noext").write_text("new")
    assert (tmp_path / "noext").read_text() == "new"


def test_a_full_disk_is_named(tmp_path: Path) -> None:
    if not os.path.exists("/dev/full"):
        pytest.skip("this system has no /dev/full")
    with (
        pytest.raises(OutputError, match=r"no space left on \.: .* free \(writing big\.tif\)"),
        writing("big.tif"),
        open("/dev/full", "w") as file,
    ):
        file.write("x" * 100_000)


def test_errors_of_a_library_become_output_errors_with_the_cause() -> None:
    def write() -> None:
        try:
            raise FakeLibraryError("no space left in the layer")
        except FakeLibraryError as error:
            raise FakeLibraryError("write failed. See the exception before.") from error

    with (
        pytest.raises(OutputError, match=r"cannot write a\.tif: no space left in the layer"),
        writing("a.tif"),
    ):
        write()


def test_the_message_has_the_final_name_of_a_staged_file(tmp_path: Path) -> None:
    with Outputs() as outputs:
        for name in ("my.image.tif", "noext"):
            staged = outputs.stage(tmp_path / name)
            staged.write_text("")
            with pytest.raises(OutputError) as raised, writing(staged):
                raise OSError(5, "Input/output error")
            assert str(raised.value) == f"cannot write {tmp_path / name}: Input/output error"


@pytest.mark.parametrize(
    "error", [RasterOpenError("input.tif"), ValueError("a bug"), OutputError()]
)
def test_other_errors_pass_unchanged(error: Exception) -> None:
    with pytest.raises(type(error)) as raised, writing("out.tif"):
        raise error
    assert raised.value is error
