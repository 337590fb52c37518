"""RPCs in files: GeoTIFF tags, `_RPC.TXT`, `.RPB`, and the RPC XML of DIMAP 2 and 3.

DIMAP 2 comes with Pléiades and SPOT, DIMAP 3 with Pléiades Neo. All formats are first converted to
the names of GDAL's metadata domain (see `rpc_tags`).
"""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from io import TextIOWrapper
from pathlib import Path
from zipfile import BadZipFile, ZipFile

from ..errors import GeoreferencingError, OutputError
from ..rasters.atomic import writing
from ..rasters.reading import RasterSource
from .rpc import RPC
from .rpc_tags import POLYNOMIALS, rpc_from_tags, rpc_to_tags

Tags = dict[str, str]

# Index in RPC00B of each term of RPC00A [NGA2000]. RPC00A has the product of all three coordinates
# before the squares, and cubic terms by the power of longitude, latitude and height.
_RPC00A = (0, 1, 2, 3, 4, 5, 6, 10, 7, 8, 9, 11, 14, 17, 12, 15, 18, 13, 16, 19)

# End of the names of DIMAP tiles: row and column. The first tile has the image's origin.
_TILE = re.compile(r"_R(\d+)C(\d+)$", re.IGNORECASE)

# Prefix of GDAL's names of files in ZIP archives.
_ZIP = "/vsizip/"

# Names in .RPB files, and those in GDAL's domain.
_RPB_NAMES = {
    "errBias": "ERR_BIAS",
    "errRand": "ERR_RAND",
    "lineOffset": "LINE_OFF",
    "sampOffset": "SAMP_OFF",
    "latOffset": "LAT_OFF",
    "longOffset": "LONG_OFF",
    "heightOffset": "HEIGHT_OFF",
    "lineScale": "LINE_SCALE",
    "sampScale": "SAMP_SCALE",
    "latScale": "LAT_SCALE",
    "longScale": "LONG_SCALE",
    "heightScale": "HEIGHT_SCALE",
    "lineNumCoef": "LINE_NUM_COEFF",
    "lineDenCoef": "LINE_DEN_COEFF",
    "sampNumCoef": "SAMP_NUM_COEFF",
    "sampDenCoef": "SAMP_DEN_COEFF",
}

# Units other than metres in `_RPC.TXT`.
_UNITS = {"LINE": "pixels", "SAMP": "pixels", "LAT": "degrees", "LONG": "degrees"}


def rpc_of(source: RasterSource, path: str | os.PathLike[str] | None = None) -> RPC:
    """Return the RPCs of an open raster.

    Parameters
    ----------
    source
        The raster; GDAL has found RPCs in its tags, or in files beside it.
    path
        A file with RPCs to use instead.

    Raises
    ------
    GeoreferencingError
        There are no RPCs, they cannot be understood, or they belong to the whole image of which the
        raster is a tile.
    """
    if path is not None:
        _require_whole(source, path)
        return read_rpc(path)
    tags = source.tags.get("RPC")
    if not tags:
        raise GeoreferencingError(
            f"{source.path} has no RPCs; give the file that holds them (_RPC.TXT, .RPB, RPC .XML)"
        )
    for name in source.files():
        # GDAL reads coefficients of RPC00A in the order of RPC00B.
        if name.lower().endswith(".rpb") and _is_rpc00a(name):
            return read_rpc(name)
    return rpc_from_tags(tags, source.path)


def _require_whole(source: RasterSource, path: str | os.PathLike[str]) -> None:
    tile = _TILE.search(Path(source.path).stem)
    if Path(path).suffix.lower() == ".xml" and tile and (int(tile[1]), int(tile[2])) != (1, 1):
        raise GeoreferencingError(
            f"{source.path} is a tile of an image, and {path} holds the RPCs of all of it: put the "
            "product's DIM_….XML and RPC_….XML beside the tile, where GDAL finds and shifts them, "
            "and give no RPC file"
        )


def _is_rpc00a(name: str) -> bool:
    try:
        return _spec_id(_text_of(name, "replace")) == "RPC00A"
    except OSError:
        # Files that only GDAL can read, as on another machine or in other archives, are left to it.
        return False


def _text_of(name: str, errors: str = "strict") -> str:
    """Return the text of a file, also of one in a ZIP archive; raises `OSError`."""
    if not name.startswith(_ZIP):
        return Path(name).read_text("utf-8-sig", errors)
    # GDAL may name the archive in braces.
    path = Path(re.sub("[{}]", "", name.removeprefix(_ZIP)))
    archive = next((folder for folder in path.parents if folder.is_file()), path)
    try:
        with ZipFile(archive) as files, files.open(path.relative_to(archive).as_posix()) as file:
            return TextIOWrapper(file, "utf-8-sig", errors).read()
    except (BadZipFile, KeyError, RuntimeError) as error:
        raise OSError(str(error)) from error


def read_rpc(path: str | os.PathLike[str]) -> RPC:
    """Read RPCs from a `_RPC.TXT`, `.RPB` or DIMAP RPC XML file.

    Raises
    ------
    GeoreferencingError
        The file cannot be read, or holds no RPCs.
    """
    name = os.fspath(path)
    parse = _READERS.get(Path(name).suffix.lower())
    if parse is None:
        raise GeoreferencingError(f"RPCs are read from {', '.join(READ_SUFFIXES)}: {name}")
    try:
        tags = parse(_text_of(name))
    except (OSError, UnicodeDecodeError, ElementTree.ParseError, ValueError) as error:
        raise GeoreferencingError(f"cannot read the RPCs {name}: {error}") from error
    return rpc_from_tags(tags, name)


def write_rpc(path: str | os.PathLike[str], rpc: RPC) -> None:
    """Write RPCs as text in the format that the suffix of `path` names, `.txt` or `.rpb`.

    GDAL finds them as `IMAGE_RPC.TXT` or `IMAGE.RPB` beside `IMAGE.TIF`.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is not known.
    """
    write = _WRITERS.get(Path(path).suffix.lower())
    if write is None:
        raise OutputError(f"RPCs are written as {', '.join(SUFFIXES)}: {path}")
    with writing(path):
        Path(path).write_text(write(rpc_to_tags(rpc)), encoding="utf-8", newline="\n")


def _read_text(text: str) -> Tags:
    """Read `_RPC.TXT`: a name, a colon, a number and its unit on each line."""
    tags: Tags = {}
    for line in text.splitlines():
        key, colon, value = line.partition(":")
        if colon and value.split():
            tags[key.strip().upper()] = value.split()[0]
    return _joined(tags)


def _write_text(tags: Tags) -> str:
    lines = []
    for key, value in tags.items():
        if key.endswith("COEFF"):
            lines += [f"{key}_{i}: {word}" for i, word in enumerate(value.split(), start=1)]
        else:
            unit = _UNITS.get(key.partition("_")[0], "meters")
            lines.append(f"{key}: {value} {unit}")
    return "\n".join(lines) + "\n"


def _read_rpb(text: str) -> Tags:
    """Read `.RPB`: statements with an equals sign, lists in brackets, in a group IMAGE."""
    kind = _spec_id(text)
    if kind not in ("RPC00A", "RPC00B"):
        raise ValueError(f"coefficients of kind {kind} are not supported, only RPC00A and RPC00B")
    # Matches begin at the start of a word, or a text of one long word would take quadratic time.
    pairs = re.findall(r"\b(\w+)\s*=\s*(\([^)]*\)|[^;\n]*)", text)
    tags = {_RPB_NAMES[key]: value.strip("() \r;") for key, value in pairs if key in _RPB_NAMES}
    return _from_rpc00a(tags) if kind == "RPC00A" else tags


def _spec_id(text: str) -> str:
    """Return the order of coefficients that an `.RPB` states, RPC00B by default."""
    found = re.search(r'SpecId\s*=\s*"?(\w+)', text, re.IGNORECASE)
    return found[1].upper() if found else "RPC00B"


def _from_rpc00a(tags: Tags) -> Tags:
    """Return coefficients of RPC00A in the order of RPC00B."""
    ordered = dict(tags)
    for key, value in tags.items():
        words = re.split(r"[\s,]+", value.strip())
        if key.endswith("COEFF") and len(words) == len(_RPC00A):
            ordered[key] = " ".join(words[_RPC00A.index(place)] for place in range(len(words)))
    return ordered


def _write_rpb(tags: Tags) -> str:
    lines = ['satId = "????";', 'bandId = "?";', 'SpecId = "RPC00B";', "BEGIN_GROUP = IMAGE"]
    for name, key in _RPB_NAMES.items():
        value = tags[key]
        if key.endswith("COEFF"):
            value = "(\n" + ",\n".join(f"\t\t\t{word}" for word in value.split()) + ")"
        lines.append(f"\t{name} = {value};")
    return "\n".join([*lines, "END_GROUP = IMAGE", "END;"]) + "\n"


def _read_dimap(text: str) -> Tags:
    """Read DIMAP 2 or 3, where the inverse model leads from the ground to the image."""
    root = ElementTree.fromstring(text)
    model, first = root.find(".//Global_RFM/Inverse_Model"), 1
    if model is None:
        model = root.find(".//Rational_Function_Model//GroundtoImage_Values")
        first = 1 if model is None else _dimap3_first(root)
    validity = root.find(".//RFM_Validity")
    if model is None or validity is None:
        raise ValueError("it holds no RPCs of DIMAP 2 (Global_RFM) or 3 (Rational_Function_Model)")
    tags = _joined({e.tag: (e.text or "").strip() for part in (model, validity) for e in part})
    for key in ("LINE_OFF", "SAMP_OFF"):
        if key in tags:
            tags[key] = f"{float(tags[key]) - first:.17g}"
    return tags


def _dimap3_first(root: ElementTree.Element) -> int:
    """Return the number of the first line and sample in DIMAP 3 (Pléiades Neo): 0 or 1."""
    domain = ".//ImagetoGround_Validity_Domain/FIRST_"
    firsts = {root.findtext(domain + name, "").strip() for name in ("ROW", "COL")}
    numbers = {float(text) for text in firsts if text}
    if numbers not in ({0.0}, {1.0}):
        raise ValueError("it does not state whether its pixels are counted from 0 or from 1")
    return int(numbers.pop())


def _joined(tags: Tags) -> Tags:
    """Join the twenty coefficients of each polynomial, which have a name of their own each."""
    joined = {key: value for key, value in tags.items() if "COEFF" not in key}
    for key in POLYNOMIALS:
        words = [tags[f"{key}_{i}"] for i in range(1, 21) if f"{key}_{i}" in tags]
        if words:
            joined[key] = " ".join(words)
    return joined


_READERS: dict[str, Callable[[str], Tags]] = {
    ".txt": _read_text,
    ".rpb": _read_rpb,
    ".xml": _read_dimap,
}
_WRITERS: dict[str, Callable[[Tags], str]] = {".txt": _write_text, ".rpb": _write_rpb}

READ_SUFFIXES, SUFFIXES = tuple(_READERS), tuple(_WRITERS)
