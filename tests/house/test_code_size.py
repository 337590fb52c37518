"""What counts as code, and what as the product."""

from __future__ import annotations

from pathlib import Path

from scripts.code_size import code_lines, is_apart


def test_docstrings_comments_and_blank_lines_are_no_code() -> None:
    source = (
        '"""Doc."""\n\n# why\nX = """a\nb"""\n\n\ndef f():\n    """Doc\n    doc."""\n    return X\n'
    )
    assert code_lines(source) == 4


def test_simulators_and_studies_are_apart() -> None:
    assert is_apart(Path("studies/radon.py")) and is_apart(Path("tools/simulate_sensor.py"))
    assert not is_apart(Path("tools/coregister.py")) and not is_apart(Path("similarity/peak.py"))
