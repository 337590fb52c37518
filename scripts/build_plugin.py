"""Build the QGIS plugin: one zip with the plugin, the bundled library and their metadata."""

from __future__ import annotations

import argparse
import configparser
import os
import re
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from scripts.help_pages import can_make_pages, help_pages

TOP = "groundtie_qgis"
# The oldest date that a zip can hold; a fixed date makes builds of the same tree identical.
DATE = (1980, 1, 1, 0, 0, 0)
NO_PAGES = "without the pages of its help, which need the package markdown-it-py to be built"


def build(root: Path, target: Path) -> Path:
    """Build the plugin of a source tree.

    Parameters
    ----------
    root : Path
        Root of the repository.
    target : Path
        The zip to write; it appears under this name only when it is complete.

    Returns
    -------
    Path
        `target`.

    Raises
    ------
    FileNotFoundError
        If a part of the plugin is missing in the tree.
    ValueError
        If two files would get the same name.
    """
    contents = collect(root)
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(target.name + ".part")
    try:
        with zipfile.ZipFile(part, "w") as archive:
            for name in sorted(contents):
                info = zipfile.ZipInfo(f"{TOP}/{name}", DATE)
                info.create_system = 3  # Unix, whatever the build system
                info.external_attr = 0o100644 << 16
                archive.writestr(info, contents[name], zipfile.ZIP_DEFLATED, 9)
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)
    return target


def collect(root: Path) -> dict[str, bytes]:
    """Read the contents of the plugin's folder, by their names in it."""
    plugin, library = root / "plugin" / TOP, root / "algorithms" / "groundtie"
    for package in (plugin, library):
        if not (package / "__init__.py").is_file():
            raise FileNotFoundError(f"no package to bundle: {package}")
    contents: dict[str, bytes] = {}
    for folder, prefix in ((plugin, ""), (library, "groundtie/")):
        for path in source_files(folder):
            add(contents, prefix + path.relative_to(folder).as_posix(), path.read_bytes())
    for name in ("metadata.txt", "LICENSE"):
        add(contents, name, (root / name).read_bytes())
    add(contents, "requirements.txt", requirements(root / "pyproject.toml").encode())
    docs = root / "docs"
    if docs.is_dir() and can_make_pages():
        for name, data in help_pages(docs).items():
            add(contents, f"help/{name}", data)
    return contents


def add(contents: dict[str, bytes], name: str, data: bytes) -> None:
    if name in contents:
        raise ValueError(f"two files for {name}")
    contents[name] = data


def source_files(folder: Path) -> Iterator[Path]:
    """Walk the files below a folder, without caches, hidden files and editors' backups."""
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        junk = any(part.startswith(".") or part == "__pycache__" for part in parts)
        if path.is_file() and not junk and not path.name.endswith((".pyc", ".pyo", "~")):
            yield path


def requirements(pyproject: Path) -> str:
    """Return the package's dependencies as the text of a pip requirements file."""
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    return "".join(f"{dependency}\n" for dependency in project["dependencies"])


def obstacles(root: Path) -> list[str]:
    """Return why a tree cannot be released: placeholders, or help pages that cannot be built."""
    parser = configparser.ConfigParser(interpolation=None)
    parser.read(root / "metadata.txt", encoding="utf-8")
    general = parser["general"]
    found = [
        f"metadata.txt: {key} is a placeholder: {general[key]}"
        for key in ("homepage", "tracker", "repository", "email")
        if re.search(r"\bexample\.(org|com|net)\b", general[key])
    ]
    if not can_make_pages():
        found.append(NO_PAGES)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", type=Path)
    parser.add_argument(
        "--release", action="store_true", help="refuse to build what must not be released"
    )
    root, arguments = Path(__file__).resolve().parents[1], parser.parse_args()
    if arguments.release and (found := obstacles(root)):
        print("not built, as it is no release:", *found, sep="\n  ", file=sys.stderr)
        return 1
    target = build(root, arguments.target)
    print(f"{target}: {target.stat().st_size / 1e6:.2f} MB")
    if not can_make_pages():
        print(NO_PAGES, file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
