"""Check by pip that the packages of *Install what is missing* exist for the Pythons of other QGIS.

It needs the network and installs nothing.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from scripts.build_plugin import requirements

ROOT = Path(__file__).resolve().parents[1]
PLATFORMS = {
    "Windows": ("win_amd64",),
    "macOS, Intel": ("macosx_10_9_x86_64", "macosx_12_0_x86_64", "macosx_14_0_x86_64"),
    "macOS, Apple": ("macosx_11_0_arm64", "macosx_12_0_arm64", "macosx_14_0_arm64"),
}
# A numpy 1 and a numpy 2 that QGIS may have with each Python; the plugin keeps QGIS's numpy.
NUMPYS = {"3.10": ("1.26.4", "2.2.6"), "3.12": ("1.26.4", "2.2.6")}


@dataclass(frozen=True)
class Target:
    """A QGIS on another system: its platform, Python and numpy."""

    system: str
    python: str
    numpy: str

    def command(self) -> list[str]:
        """Return pip's dry run for this target."""
        platforms = [f"--platform={name}" for name in PLATFORMS[self.system]]
        return [
            *(sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--ignore-installed"),
            *("--only-binary=:all:", f"--python-version={self.python}", *platforms),
            *("--report=-", "--target", tempfile.gettempdir()),
            *requirements(ROOT / "pyproject.toml").split("\n")[:-1],
            *(f"numpy=={self.numpy}", "affine<3"),
        ]


def targets() -> Iterator[Target]:
    for system in PLATFORMS:
        for python, numpys in NUMPYS.items():
            yield from (Target(system, python, numpy) for numpy in numpys)


def resolved(target: Target) -> str:
    """Return the packages that pip would install for a target, or the reason why it cannot."""
    called = subprocess.run(target.command(), capture_output=True, text=True, check=False)
    if called.returncode:
        return f"FAILED: {called.stderr.strip().splitlines()[-1]}"
    packages = [item["metadata"] for item in json.loads(called.stdout)["install"]]
    shown = ("rasterio", "opencv-python-headless", "fiona", "scipy", "scikit-learn", "matplotlib")
    versions = {package["name"].lower(): package["version"] for package in packages}
    return ", ".join(f"{name} {versions[name]}" for name in shown if name in versions)


def main() -> int:
    results = {target: resolved(target) for target in targets()}
    for target, result in results.items():
        print(f"{target.system}, Python {target.python}, numpy {target.numpy}: {result}")
    return int(any(result.startswith("FAILED") for result in results.values()))


if __name__ == "__main__":
    raise SystemExit(main())
