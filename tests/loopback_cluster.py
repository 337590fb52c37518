"""A Dask scheduler and two worker processes on loopback, for the tests: `with cluster() as it`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Cluster:
    """Where the scheduler listens, and the numbers of the workers' processes."""

    address: str
    workers: tuple[int, ...]


@contextmanager
def cluster() -> Iterator[Cluster]:
    """Run a cluster in another process, whose warnings and threads are not pytest's."""
    path = os.pathsep.join([str(ROOT / "algorithms"), str(ROOT / "tests")])
    with subprocess.Popen(
        [sys.executable, __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    ) as process:
        assert process.stdout is not None and process.stdin is not None
        facts = json.loads(process.stdout.readline())
        try:
            yield Cluster(facts["address"], tuple(facts["workers"]))
        finally:
            process.stdin.close()  # ends it


def main() -> None:
    import distributed

    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as made,
        distributed.Client(made) as client,
    ):
        numbers = list(client.run(os.getpid).values())
        print(json.dumps({"address": made.scheduler_address, "workers": numbers}), flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
