from __future__ import annotations

import os
from pathlib import Path

import pytest

from groundtie.errors import CancelledError, OutputError, RasterOpenError
from groundtie.rasters import atomic
from groundtie.rasters.atomic import Outputs, writing


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
            for suffix in ("", ".aux.xml", ".ovr", ".msk", "-wal", "-shm", "-journal"):
                (tmp_path / (staged.name + suffix)).write_text("half")
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


def test_sidecars_go_along_and_replace_those_of_the_old_file(tmp_path: Path) -> None:
    final = tmp_path / "points.gpkg"
    for suffix in ("", ".aux.xml", "-wal"):
        (tmp_path / (final.name + suffix)).write_text("old")
    with Outputs() as outputs:
        staged = outputs.stage(final)
        staged.write_text("new")
        (tmp_path / (staged.name + "-wal")).write_text("new")
    # The old .aux.xml held statistics of another file.
    assert sorted(os.listdir(tmp_path)) == ["points.gpkg", "points.gpkg-wal"]
    assert final.read_text() == "new"
    assert (tmp_path / "points.gpkg-wal").read_text() == "new"


def test_neighbours_with_alike_names_are_left_alone(tmp_path: Path) -> None:
    for name in ("image.tif.txt", "image.tiff", "image.png"):
        (tmp_path / name).write_text(name)
    with Outputs() as outputs:
        outputs.stage(tmp_path / "image.tif").write_text("new")
    assert len(os.listdir(tmp_path)) == 4


def test_all_old_files_come_back_if_one_cannot_be_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finals = [tmp_path / name for name in ("a.tif", "b.csv")]
    for final in finals:
        final.write_text("old")
    replace = os.replace

    def refuse_b(source: Path, target: Path) -> None:
        if target == finals[1] and "-new" in source.name:
            raise PermissionError(13, "b.csv is open in another program")
        replace(source, target)

    def work() -> None:
        with Outputs() as outputs:
            for final in finals:
                outputs.stage(final).write_text("new")
            monkeypatch.setattr(atomic.os, "replace", refuse_b)

    with pytest.raises(OutputError, match=r"b\.csv: b\.csv is open"):
        work()
    assert sorted(os.listdir(tmp_path)) == ["a.tif", "b.csv"]
    assert [final.read_text() for final in finals] == ["old", "old"]


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
        pytest.raises(OutputError, match=r"cannot write big\.tif: the disk is full"),
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
