"""The budget of memory: what states it, and what is given of it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import rasterio.env
from toys import TOY, run_tools

import groundtie
from groundtie import memory
from groundtie.errors import MemoryLimitError, ParameterError

PACKAGE = Path(__file__).resolve().parents[1] / "algorithms"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(PACKAGE)}

GOOD = ["toy", "a.tif", "b.tif", "c.tif", "--size", "3"]


@pytest.fixture(autouse=True)
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.tif", "b.tif"):
        Path(name).touch()


def test_gdal_gets_a_share_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(memory.VARIABLE, raising=False)
    with memory.bounded_cache():
        assert rasterio.env.getenv()["GDAL_CACHEMAX"] == 200_000_000
    monkeypatch.setenv(memory.VARIABLE, "250")
    assert memory.share_bytes(memory.DATES_SHARE) == 100_000_000
    with memory.bounded_cache():
        assert rasterio.env.getenv()["GDAL_CACHEMAX"] == 50_000_000


@pytest.mark.parametrize("text", ["", "much", "99", "-1", "nan", "inf", "1e9"])
def test_no_amount_is_an_error(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(memory.VARIABLE, text)
    with pytest.raises(ParameterError, match="must be 100 to 1000000 megabytes, not"):
        memory.budget_bytes()


@pytest.mark.parametrize("before", [None, "300"])
def test_the_command_line_sets_it_for_one_command(
    monkeypatch: pytest.MonkeyPatch, before: str | None
) -> None:
    monkeypatch.delenv(memory.VARIABLE, raising=False)
    if before is not None:
        monkeypatch.setenv(memory.VARIABLE, before)
    seen = []

    def run(**values: object) -> object:
        seen.append(memory.budget_bytes())
        raise ParameterError("seen")

    tool = replace(TOY, run=run)
    assert run_tools(["--memory", "400", *GOOD], [tool]) == 2
    assert seen == [400_000_000]
    assert os.environ.get(memory.VARIABLE) == before


def test_a_bad_amount_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_tools(["--memory", "0.5", *GOOD], [TOY]) == 2
    error = capsys.readouterr().err
    assert "--memory" in error and "must be 100 to" in error and len(error.splitlines()) == 1


@pytest.mark.parametrize("tool", [groundtie.simulate, groundtie.simulate_sensor])
def test_a_scene_that_does_not_fit_is_refused_before_anything_is_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, tool: Callable[..., object]
) -> None:
    monkeypatch.setenv(memory.VARIABLE, "1000")
    words = r"takes \d\.\d\d GB, more than the budget of 1\.00 GB"
    with pytest.raises(MemoryLimitError, match=words) as error:
        tool(tmp_path / "out", size=5000)
    assert len(str(error.value).splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_the_surroundings_of_a_scene_count_too(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(memory.VARIABLE, "300")
    with pytest.raises(MemoryLimitError, match="with its surroundings"):
        groundtie.simulate(tmp_path / "out", size=200, shift=2000)
    monkeypatch.setenv(memory.VARIABLE, "200")
    assert groundtie.simulate(tmp_path / "out", size=200).files


# Of this process alone: `ru_maxrss` is no less than that of the process that started it.
PEAK = """
import sys
from pathlib import Path
import groundtie
getattr(groundtie, sys.argv[1])(sys.argv[2], size=int(sys.argv[3]))
print(1024 * int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="what Linux counts")
@pytest.mark.parametrize("tool", ["simulate", "simulate_sensor"])
def test_what_a_simulation_takes_is_foreseen(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, tool: str
) -> None:
    words = [sys.executable, "-c", PEAK, tool, str(tmp_path / "out"), "1500"]
    environment = {**ENVIRONMENT, memory.VARIABLE: "1000"}
    done = subprocess.run(words, env=environment, text=True, capture_output=True, check=True)
    monkeypatch.setenv(memory.VARIABLE, "100")
    with pytest.raises(MemoryLimitError) as error:
        getattr(groundtie, tool)(tmp_path / "none", size=1500)
    foreseen = re.search(r"takes ([0-9.]+) GB", str(error.value))
    assert foreseen is not None
    assert 1e9 * float(foreseen[1]) == pytest.approx(float(done.stdout), rel=0.15)


HEAPS = """
import ctypes, threading
from groundtie.memory import set_heaps
if {shared}:
    set_heaps()
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
wait = threading.Barrier(9)
def hold():
    libc.malloc(ctypes.c_size_t(1000))
    wait.wait()
    wait.wait()
for _ in range(8):
    threading.Thread(target=hold).start()
wait.wait()
libc.malloc_stats()
wait.wait()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's heaps")
@pytest.mark.parametrize("shared", [False, True])
def test_threads_set_heaps(shared: bool) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HEAPS.format(shared=shared)],
        env=ENVIRONMENT,
        text=True,
        capture_output=True,
        check=True,
    )
    heaps = done.stderr.count("Arena ")
    assert heaps == 2 if shared else heaps > 2


FAULTS = """
import resource, sys, types
import numpy as np
from groundtie.executors import enter_worker

if {is_worker}:
    sys.modules["distributed"] = types.ModuleType("distributed")
enter_worker()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(200):
    np.ones(1 << 17)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's heaps")
@pytest.mark.parametrize("is_worker", [False, True])
@pytest.mark.slow
def test_a_dask_worker_does_not_give_back_each_array(is_worker: bool) -> None:
    """Dask's own setting costs a page fault for each 4 kB of each array of 1 MB."""
    done = subprocess.run(
        [sys.executable, "-c", FAULTS.format(is_worker=is_worker)],
        env={**ENVIRONMENT, "MALLOC_TRIM_THRESHOLD_": "65536"},
        text=True,
        capture_output=True,
        check=True,
    )
    assert (int(done.stdout) < 2000) == is_worker
