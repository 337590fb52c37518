"""Pools of processes and threads: what dies, what is stopped, and what stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from own_processes import ENVIRONMENT

from groundtie import executors
from groundtie.errors import ParameterError, SchedulerError, WorkerLostError
from groundtie.executors import Processes, Threads, open_executor, stop_requested

# Of Debian 12's tornado, by Dask's own client.
pytestmark = pytest.mark.filterwarnings("ignore:make_current is deprecated:DeprecationWarning")

ROOT = Path(__file__).resolve().parents[1]


def process_number() -> int:
    return os.getpid()


def die(marker: Path, times: int) -> int:
    """Kill the process that runs this, so many times."""
    lives = len(list(marker.parent.glob(f"{marker.name}*")))
    if lives < times:
        (marker.parent / f"{marker.name}{lives}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return lives


def wait_for_stop(seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if stop_requested():
            return True
        time.sleep(0.01)
    return False


@pytest.mark.slow
def test_a_killed_process_costs_no_task(tmp_path: Path) -> None:
    with Processes(1) as pool:
        before = pool.submit(process_number).result()
        assert pool.submit(die, tmp_path / "once", 1).result() == 1
        assert pool.submit(process_number).result() not in (before, os.getpid())
        with pytest.raises(WorkerLostError, match="ended 2 times"):
            pool.submit(die, tmp_path / "ever", 9).result()
        assert pool.submit(process_number).result() != os.getpid()


@pytest.mark.slow
def test_tasks_are_asked_to_stop_in_threads_and_processes() -> None:
    for kind in (Threads, Processes):
        pool = kind(1)
        pool.submit(process_number).result()
        running, waiting = pool.submit(wait_for_stop, 20.0), pool.submit(process_number)
        while not running.running():
            time.sleep(0.01)
        pool.shutdown(cancel_futures=True)
        assert running.result() is True
        assert waiting.cancelled()


def test_nothing_is_asked_to_stop_elsewhere() -> None:
    assert stop_requested() is False


@pytest.mark.slow
def test_processes_end_with_their_parent(tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(
        "import os, sys, time\n"
        "from groundtie.executors import Processes\n"
        "def main():\n"
        "    pool = Processes(1)\n"
        "    print(pool.submit(os.getpid).result(), flush=True)\n"
        "    time.sleep(60)\n"
        "if __name__ == '__main__':\n"
        "    main()\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "algorithms")}
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        parent.kill()
    end = time.monotonic() + 10
    while Path(f"/proc/{child}").exists() and time.monotonic() < end:
        if Path(f"/proc/{child}/stat").read_text().split()[2] == "Z":
            break  # ended; nobody collects it here
        time.sleep(0.02)
    else:
        assert not Path(f"/proc/{child}").exists()


def test_threads_alone_run_inside_qgis(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "qgis.core", sys)
    with open_executor(2) as pool:
        assert pool.submit(process_number).result() == os.getpid()


WHERE = """
import multiprocessing, os
from groundtie.executors import open_executor

def is_here(number=0):
    with open_executor(1) as pool:
        return pool.submit(os.getpid).result() == os.getpid()
"""
GUARDED = """
if __name__ == "__main__":
    print(is_here())
"""
IN_A_POOL = """
if __name__ == "__main__":
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        print(*pool.map(is_here, [0]))
"""


def run_python(words: list[str], script: str = "") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *words]
    return subprocess.run(
        command, input=script, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("script", "is_here"), [(WHERE + GUARDED, "False"), (WHERE + IN_A_POOL, "True")]
)
def test_threads_run_where_no_process_may_have_any(
    tmp_path: Path, script: str, is_here: str
) -> None:
    """A worker of `multiprocessing.Pool` is a daemon."""
    path = tmp_path / "script.py"
    path.write_text(script)
    done = run_python([str(path)])
    assert (done.stdout, done.stderr) == (f"{is_here}\n", "")


@pytest.mark.parametrize("program", ["-", "/dev/stdin"])
def test_threads_run_where_no_process_could_read_the_program(program: str) -> None:
    """From a pipe it is read once; bash's <(cat script.py) is one by a name, too."""
    done = run_python([program], WHERE + GUARDED)
    assert (done.stdout, done.stderr) == ("True\n", "")


def test_a_folder_that_is_a_program_starts_processes(tmp_path: Path) -> None:
    (tmp_path / "__main__.py").write_text(WHERE + GUARDED)
    assert run_python([str(tmp_path)]).stdout == "False\n"


def test_a_session_without_a_program_starts_processes() -> None:
    """As in a notebook: there is nothing to read."""
    assert run_python(["-c", WHERE + GUARDED]).stdout == "False\n"


def test_a_program_without_a_guard_is_told(tmp_path: Path) -> None:
    """Each process would start the program from its beginning."""
    path = tmp_path / "script.py"
    path.write_text(
        "import os\n"
        "from groundtie.executors import open_executor\n"
        "with open_executor(1) as pool:\n"
        "    for _ in range(3):\n"
        "        print(pool.submit(os.getpid).exception(), flush=True)\n"
    )
    done = run_python([str(path)])
    lines = done.stdout.splitlines()
    assert len(lines) == 3
    assert all('if __name__ == "__main__":' in line for line in lines)
    # Not for each task.
    assert done.stderr.count("ParameterError: ") == executors._ATTEMPTS


def test_a_program_with_a_guard_is_not_told_that_it_has_none(tmp_path: Path) -> None:
    path = tmp_path / "script.py"
    path.write_text(
        "import os\n"
        "from groundtie.executors import open_executor\n"
        "if __name__ == '__main__':\n"
        "    with open_executor(1) as pool:\n"
        "        print(pool.submit(os.getpid).exception())\n"
        "else:\n"
        "    os.kill(os.getpid(), 9)\n"
    )
    assert run_python([str(path)]).stdout == (
        "no process could be started (out of memory? or by a program that starts some without "
        'if __name__ == "__main__":)\n'
    )


@pytest.mark.slow
def test_processes_that_begin_late_run_tasks() -> None:
    """One that memory ran out for at first tells nothing of the others."""
    with Processes(1) as pool:
        pool._have_none_begun.set()
        with pytest.raises(WorkerLostError, match="no process could be started"):
            pool.submit(process_number).result()
        pool._begun.set()
        assert pool.submit(process_number).result() != os.getpid()


class TestScheduler:
    @pytest.mark.slow
    def test_one_that_is_not_there_is_one_line(self, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip("distributed", reason="the extra cluster is not installed")
        assert executors._CONNECT_SECONDS <= 5
        monkeypatch.setattr(executors, "_CONNECT_SECONDS", 0.5)
        started = time.monotonic()
        with (
            pytest.raises(SchedulerError, match=r"no Dask scheduler answers at tcp://127.0.0.1:9$"),
            open_executor(2, "tcp://127.0.0.1:9"),
        ):
            pass
        assert time.monotonic() - started < 5

    def test_an_address_is_one(self) -> None:
        pytest.importorskip("distributed", reason="the extra cluster is not installed")
        for address, error in (("host:8786", ParameterError), ("fly://host:1", SchedulerError)):
            with pytest.raises(error, match="host"), open_executor(2, address):
                pass

    def test_a_missing_package_is_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "distributed", None)
        with (
            pytest.raises(SchedulerError, match=r"pip install 'groundtie\[cluster\]'"),
            open_executor(2, "tcp://127.0.0.1:9"),
        ):
            pass
