"""The plugin's texts in the language of QGIS, from Qt Linguist's files `i18n/groundtie_XX.ts`.

The files are read directly: the plugin needs only its own texts, and a changed file need not be
compiled. `scripts/translations.py` keeps them complete.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from xml.etree import ElementTree

FOLDER = Path(__file__).resolve().parent / "i18n"


def tr(text: str) -> str:
    """Return a text in the language of QGIS; without a translation, it is unchanged."""
    return _texts(language()).get(text, text)


def mark(text: str) -> str:
    """Mark a text for translation where it is shown, and return it unchanged."""
    return text


def language() -> str:
    """Return the two-letter language code of QGIS."""
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
