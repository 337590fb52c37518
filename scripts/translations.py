"""Keep the plugin's translations complete: plugin/groundtie_qgis/i18n/*.ts, for Qt Linguist.

New texts are added as unfinished, obsolete ones are removed. Texts are the arguments of `tr` and
`mark` in the plugin's source, and the texts of the tools' declarations and of the models.
"""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from groundtie.kinds import Choice
from groundtie.tools import NAMES, load_tools
from scripts import make_models

PLUGIN = Path(__file__).resolve().parents[1] / "plugin" / "groundtie_qgis"
_CONTEXT = "GroundTie"


def texts() -> list[str]:
    """Return all texts to translate, sorted."""
    found = {*_of_source(), *_of_declarations(), *_of_models()}
    return sorted(found - {""})


def _of_source() -> Iterator[str]:
    for path in PLUGIN.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("tr", "mark"):
                value = node.args[0]
                if isinstance(value, ast.Constant) and isinstance(value.value, str):
                    yield value.value


def _of_declarations() -> Iterator[str]:
    label_of = plugin_module("choice_labels").label_of
    for tool in load_tools():
        yield from (tool.title, tool.group, tool.summary)
        yield from (" ".join(text.split()) for text in tool.description.split("\n\n"))
        yield from (output.label for output in tool.outputs)
        for parameter in tool.parameters:
            yield from (parameter.kind.label, parameter.kind.help)
            if isinstance(parameter.kind, Choice):
                yield from (label_of(word) for word in parameter.kind.choices if word not in NAMES)


def plugin_module(name: str) -> ModuleType:
    """Import a module that needs no QGIS, bypassing the plugin's package, which needs it."""
    spec = importlib.util.spec_from_file_location(name, PLUGIN / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _of_models() -> Iterator[str]:
    yield make_models.GROUP
    for path in make_models.FOLDER.glob("*.model3"):
        for option in ElementTree.parse(path).iter("Option"):
            if option.get("name") in ("TITLE", "SHORT_DESCRIPTION"):
                yield option.get("value", "")


def write(path: Path, translations: dict[str, str], wanted: list[str]) -> int:
    """Write the wanted texts with their translations; return the number without one."""
    root = ElementTree.Element("TS", version="2.1", language=path.stem.rpartition("_")[2])
    context = ElementTree.SubElement(root, "context")
    ElementTree.SubElement(context, "name").text = _CONTEXT
    for text in wanted:
        message = ElementTree.SubElement(context, "message")
        ElementTree.SubElement(message, "source").text = text
        translation = ElementTree.SubElement(message, "translation")
        if text in translations:
            translation.text = translations[text]
        else:
            translation.set("type", "unfinished")
    ElementTree.indent(root)
    document = ElementTree.tostring(root, encoding="unicode")
    path.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE TS>\n{document}\n')
    return len(set(wanted) - set(translations))


def main() -> int:
    wanted, read = texts(), plugin_module("translation").read
    for path in sorted((PLUGIN / "i18n").glob("*.ts")):
        print(f"{path}: {write(path, read(path), wanted)} of {len(wanted)} texts are unfinished")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
