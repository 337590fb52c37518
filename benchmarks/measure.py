"""Run a command and write its wall-clock time, processor time and peak memory as JSON.

Run as `python measure.py RESULT.json COMMAND…`. It runs as a small process of its own, because a
child's peak memory includes that of the process that started it.
"""

import json
import os
import sys
import time


def main() -> int:
    result, command = sys.argv[1], sys.argv[2:]
    started = time.perf_counter()
    child = os.posix_spawnp(command[0], command, os.environ)
    _, status, usage = os.wait4(child, 0)
    values = {
        "seconds": time.perf_counter() - started,
        "processor_seconds": usage.ru_utime + usage.ru_stime,
        "peak_bytes": usage.ru_maxrss * 1024,
        "exit_code": os.waitstatus_to_exitcode(status),
    }
    with open(result, "w", encoding="utf-8") as stream:
        json.dump(values, stream)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
