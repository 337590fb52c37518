"""The shell scripts install what is missing, only where they may, and never skip in silence.

Each runs in a copy of the tree's scripts with programs of ours first on PATH, which note how they
were called.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BASH = shutil.which("bash") or "/bin/bash"


class Machine:
    """A folder of programs that stand in for the system's, and a note of their calls."""

    def __init__(self, folder: Path) -> None:
        self.tree, self.bin, self.log = folder / "tree", folder / "bin", folder / "calls"
        self.bin.mkdir()
        self.log.touch()
        shutil.copytree(ROOT / "scripts", self.tree / "scripts")
        shutil.copytree(ROOT / ".ci", self.tree / ".ci")
        for name in ("bash", "dirname", "mktemp", "rm", "env", "flock"):
            (self.bin / name).symlink_to(shutil.which(name) or f"/usr/bin/{name}")

    def add(self, name: str, body: str) -> None:
        path = self.bin / name
        path.write_text(f'#!{BASH}\necho "{name} $*" >> {self.log}\n{body}\n', encoding="utf-8")
        path.chmod(0o755)

    def run(self, script: str, *args: str, **variables: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [BASH, str(self.tree / script), *args],
            env={"PATH": str(self.bin), **variables},
            cwd=self.tree,
            capture_output=True,
            text=True,
            check=False,
        )

    def calls(self, name: str) -> list[str]:
        lines = self.log.read_text(encoding="utf-8").splitlines()
        return [line for line in lines if line.startswith(name + " ")]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """Return a Debian machine without any of our packages, as root."""
    debian = Machine(tmp_path)
    debian.add("id", "echo 0")
    debian.add("dpkg-query", "exit 1")
    debian.add("dpkg", "")
    debian.add("apt-get", "")
    debian.add("true", "")
    return debian


def test_scripts_can_be_run() -> None:
    for path in (ROOT / ".ci/run", *(ROOT / "scripts").glob("*.sh")):
        assert path.stat().st_mode & stat.S_IXUSR, path
        assert "set -euo pipefail" in path.read_text(encoding="utf-8"), path


def test_missing_packages_are_installed(machine: Machine) -> None:
    done = machine.run("scripts/system_packages.sh", "one", "two")
    assert done.returncode == 0, done.stderr
    update, install = machine.calls("apt-get")
    assert update.endswith("update")
    assert install.endswith("install --no-install-recommends one two")


def test_an_interrupted_installation_is_ended_first(machine: Machine) -> None:
    machine.add("apt-get", f"grep -q 'dpkg --configure -a' {machine.log} || exit 100")
    (machine.bin / "grep").symlink_to(shutil.which("grep") or "/usr/bin/grep")
    done = machine.run("scripts/system_packages.sh", "one")
    assert done.returncode == 0, done.stderr


def test_installed_packages_are_left_alone(machine: Machine) -> None:
    machine.add("dpkg-query", '[ "${!#}" = two ] || echo -n installed')
    machine.run("scripts/system_packages.sh", "one", "two", "three")
    assert machine.calls("apt-get")[-1].endswith("recommends two")


def test_nothing_missing_needs_no_rights(machine: Machine) -> None:
    machine.add("dpkg-query", "echo -n installed")
    machine.add("id", "echo 1000")
    done = machine.run("scripts/system_packages.sh")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert machine.calls("apt-get") == []


def test_removed_package_with_its_settings_left_is_missing(machine: Machine) -> None:
    machine.add("dpkg-query", "echo -n config-files")
    machine.run("scripts/system_packages.sh", "one")
    assert machine.calls("apt-get")[-1].endswith(" one")


def test_failed_update_does_not_stop_the_installation(machine: Machine) -> None:
    machine.add("apt-get", '[[ " $* " != *" update "* ]]')
    assert machine.run("scripts/system_packages.sh", "one").returncode == 0


def test_failed_installation_is_a_failure(machine: Machine) -> None:
    machine.add("apt-get", '[[ " $* " != *" install "* ]] || exit 100')
    assert machine.run("scripts/system_packages.sh", "one").returncode == 100


def test_sudo_is_used_where_it_asks_nothing(machine: Machine) -> None:
    machine.add("id", "echo 1000")
    machine.add("sudo", 'shift; exec "$@"')
    assert machine.run("scripts/system_packages.sh", "one").returncode == 0
    assert len(machine.calls("apt-get")) == 2
    assert all(call.startswith("sudo -n ") for call in machine.calls("sudo"))


@pytest.mark.parametrize("case", ["no rights", "no apt"])
def test_one_line_says_what_to_install(machine: Machine, case: str) -> None:
    if case == "no rights":
        machine.add("id", "echo 1000")
        machine.add("sudo", "exit 1")
    else:
        (machine.bin / "apt-get").unlink()
    done = machine.run("scripts/system_packages.sh", "one", "two")
    assert done.returncode == 1
    assert re.fullmatch(r"system_packages\.sh: please install .*: one two\n", done.stderr)
    assert machine.calls("apt-get") == []


def test_first_python_that_works_makes_the_venv(machine: Machine) -> None:
    machine.add("python3.11", "exit 127")  # a pyenv shim of a Python that is not active
    machine.add("python3", "")
    machine.add("python3.12", "")
    assert machine.run("scripts/make_venv.sh", "folder").returncode == 0
    assert machine.calls("python3")[-1].endswith("-m venv --clear folder")
    assert machine.calls("python3.12") == machine.calls("apt-get") == []


def test_missing_venv_module_is_installed(machine: Machine) -> None:
    machine.add("apt-get", f'[ "${{!#}}" != python3-venv ] || : > {machine.tree}/installed')
    machine.add("python3", f'[ "$1" = -c ] || [ -e {machine.tree}/installed ]')
    assert machine.run("scripts/make_venv.sh", "folder").returncode == 0
    assert machine.calls("apt-get")[-1].endswith("install --no-install-recommends python3-venv")


def test_old_pythons_make_no_venv(machine: Machine) -> None:
    (machine.bin / "apt-get").unlink()
    machine.add("python3", '[ "$1" != -c ]')
    done = machine.run("scripts/make_venv.sh", "folder")
    assert done.returncode == 1
    assert "no Python >= 3.11" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("variables", "code", "word"),
    [
        ({}, 0, "SKIPPED"),
        ({"CI": "true"}, 1, "FAILED"),
        ({"GROUNDTIE_REQUIRE_QGIS": "1"}, 1, "FAILED"),
    ],
)
def test_missing_qgis_is_never_skipped_in_ci(
    machine: Machine, variables: dict[str, str], code: int, word: str
) -> None:
    (machine.bin / "apt-get").unlink()
    done = machine.run("scripts/test_debian.sh", **variables)
    assert done.returncode == code
    assert f"test_debian.sh: {word}: the tests with QGIS" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("user", "without", "reason"),
    [
        (1000, "", "needs root"),
        (0, "apt-get", "needs apt-get"),
        (0, "", "trixie's packages cannot be had"),
    ],
)
@pytest.mark.parametrize(("required", "code"), [("0", 0), ("1", 1)])
def test_where_a_newer_qgis_cannot_be_had_a_line_states_it(
    machine: Machine, user: int, without: str, reason: str, required: str, code: int
) -> None:
    """The third machine's apt-get names no source."""
    machine.add("id", f"echo {user}")
    machine.add("realpath", "echo /data")
    for name in ("sed", "head"):
        (machine.bin / name).symlink_to(shutil.which(name) or f"/usr/bin/{name}")
    if without:
        (machine.bin / without).unlink()
    done = machine.run("scripts/test_newer_debian.sh", GROUNDTIE_REQUIRE_QGIS=required)
    assert done.returncode == code
    line = f"test_newer_debian.sh: {reason}: the tests with trixie's QGIS did not run"
    assert done.stderr.splitlines() == [line]


def test_suite_runs_in_a_clean_environment(machine: Machine) -> None:
    machine.add("dpkg-query", "echo -n installed")
    (machine.bin / "env").unlink()
    machine.add("env", "")
    done = machine.run(
        "scripts/test_debian.sh",
        "-k",
        "some",
        VIRTUAL_ENV="/venv",
        PYTHONPATH="/venv/lib",
        CI="true",
        GROUNDTIE_DATA="/data",
    )
    assert done.returncode == 0, done.stderr
    (call,) = machine.calls("env")
    assert call.startswith("env -i PATH=/usr/bin:/bin ")
    assert call.endswith(" CI=true GROUNDTIE_DATA=/data /usr/bin/python3 -m pytest -k some")
    assert "GROUNDTIE_REQUIRE_QGIS=1" in call
    assert "venv" not in call


def test_ci_runs_the_tests_then_the_demo(machine: Machine) -> None:
    required = '[ "$GROUNDTIE_REQUIRE_QGIS" = 1 ] || [ "$1" = test-newer-qgis ]'
    machine.add("make", f"read -r line && exit 9; {required}")
    done = machine.run(".ci/run")
    assert done.returncode == 0, done.stderr
    assert machine.calls("make") == ["make test", "make test-newer-qgis", "make demo"]


@pytest.mark.parametrize(("failing", "ran"), [("test", 1), ("test-newer-qgis", 2), ("demo", 3)])
def test_ci_fails_with_its_parts(machine: Machine, failing: str, ran: int) -> None:
    machine.add("make", f'[ "$1" != {failing} ]')
    assert machine.run(".ci/run").returncode == 1
    assert len(machine.calls("make")) == ran


def test_every_target_is_explained() -> None:
    make = shutil.which("make")
    if make is None:
        pytest.skip("no make")
    environment = {**os.environ, "MAKEFLAGS": ""}
    done = subprocess.run(
        [make, "-s", "help"], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    listed = {line.split()[0] for line in done.stdout.splitlines()}
    assert listed >= {"install", "demo", "test", "lint", "bench", "plugin", "clean", "help"}
