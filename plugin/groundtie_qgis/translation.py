"""The plugin's texts in the language of QGIS, from Qt Linguist's files `i18n/groundtie_XX.ts`.

The files are read as they are: the plugin asks for its own texts alone, and nothing has to be
compiled to change one. `scripts/translations.py` keeps them complete.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from xml.etree import ElementTree

FOLDER = Path(__file__).resolve().parent / "i18n"


def tr(text: str) -> str:
    """Return a text in the language of QGIS; where that has no translation, as it is."""
    return _texts(language()).get(text, text)


def mark(text: str) -> str:
    """Return a text as it is: it is to be translated where it is shown."""
    return text


def language() -> str:
    """Return the language of QGIS: two letters."""
    from qgis.core import QgsApplication

    return str(QgsApplication.locale())[:2]


@cache
def _texts(code: str) -> dict[str, str]:
    path = FOLDER / f"groundtie_{code}.ts"
    return read(path) if path.is_file() else {}


def read(path: Path) -> dict[str, str]:
    """Return the finished translations of a file."""
    found = {}
    for message in ElementTree.parse(path).iter("message"):
        source, translation = message.find("source"), message.find("translation")
        if source is not None and translation is not None and translation.get("type") is None:
            found[source.text or ""] = translation.text or ""
    return found
