"""Results as Markdown for readers and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from .accuracy import CORRECT, SILENTLY_WRONG, VERDICTS
from .attempt import Outcome, accepted, count
from .suites import Goal, SuiteResult, Table

_REACHED = {True: "yes", False: "**no**", None: "–"}


def accuracy_table(title: str, groups: Mapping[str, Sequence[Outcome]]) -> Table:
    """Return a table with one row for each group of outcomes."""
    head = (
        "pairs",
        "σ of truth (px)",
        "runs",
        *VERDICTS,
        "median error (px)",
        "largest (px)",
        "on the lattice: correct",
        "silently wrong",
        "median (px)",
        "median s",
    )
    return Table(title, head, [_accuracy_row(name, group) for name, group in groups.items()])


def _accuracy_row(name: str, outcomes: Sequence[Outcome]) -> list[str]:
    sigmas = sorted({outcome.sigma_px for outcome in outcomes})
    lattice_errors = [o.lattice_error_px for o in accepted(outcomes)]
    return [
        name,
        "–".join(f"{sigma:g}" for sigma in dict.fromkeys((sigmas[0], sigmas[-1]))),
        str(len(outcomes)),
        *(str(count(outcomes, verdict)) for verdict in VERDICTS),
        *error_cells(outcomes),
        str(count(outcomes, CORRECT, on_lattice=True)),
        str(count(outcomes, SILENTLY_WRONG, on_lattice=True)),
        f"{np.median(lattice_errors):.2f}" if lattice_errors else "–",
        f"{np.median([o.seconds for o in outcomes]):.1f}",
    ]


def error_cells(outcomes: Sequence[Outcome]) -> tuple[str, str]:
    """Return the median and the largest error of accepted registrations."""
    errors = [outcome.error_px for outcome in accepted(outcomes)]
    return (f"{np.median(errors):.2f}", f"{max(errors):.2f}") if errors else ("–", "–")


def goals_table(goals: Sequence[Goal]) -> Table:
    """Return goals and results side by side."""
    rows = [[g.what, g.wanted, g.found, _REACHED[g.reached]] for g in goals]
    return Table("Goals", ("", "goal", "found", "reached"), rows)


def to_markdown(table: Table) -> str:
    """Return a table as Markdown; one without rows says so."""
    heading = f"### {table.title}\n\n"
    if not table.rows:
        return heading + "none\n"
    lines = [table.head, ["---"] * len(table.head), *table.rows]
    return heading + "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def suite_markdown(result: SuiteResult, about: Mapping[str, Any]) -> str:
    """Return a suite's result as Markdown."""
    parts = [f"## {result.title}\n", _about_line(about)]
    parts += [to_markdown(table) for table in (goals_table(result.goals), *result.tables)]
    parts += [f"{note}\n" for note in result.notes]
    return "\n".join(parts)


def write_result(
    name: str, result: SuiteResult, about: Mapping[str, Any], folder: Path
) -> tuple[Path, Path]:
    """Write a suite's result as <name>.md and <name>.json and return both paths."""
    folder.mkdir(parents=True, exist_ok=True)
    page, numbers = folder / f"{name}.md", folder / f"{name}.json"
    page.write_text(suite_markdown(result, about), encoding="utf-8")
    values = {
        "title": result.title,
        "about": dict(about),
        "goals": [asdict(goal) for goal in result.goals],
        "records": list(result.records),
        "notes": list(result.notes),
    }
    numbers.write_text(json.dumps(values, indent=1, allow_nan=False), encoding="utf-8")
    return page, numbers


def _about_line(about: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in about.items()) + "\n"
