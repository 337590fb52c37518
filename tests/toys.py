"""A small tool with a parameter of every kind, for the tests of what is made from declarations."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any
from unittest.mock import patch

from groundtie import cli
from groundtie.declaration import Output, Tool, tool, tool_of
from groundtie.errors import NotRegisteredError
from groundtie.kinds import (
    Band,
    Choice,
    Distance,
    FileIn,
    FileOut,
    Flag,
    FolderOut,
    MaskIn,
    Number,
    RasterIn,
    RasterOut,
    RastersIn,
    Text,
    VectorIn,
    VectorOut,
)
from groundtie.progress import SILENT, Progress
from groundtie.rasters.atomic import Outputs


@dataclass(frozen=True)
class ToyVerdict:
    """A verdict with a summary."""

    reason: str

    def summary(self) -> dict[str, Any]:
        return {"accepted": False, "reason": self.reason}


@dataclass(frozen=True)
class ToyResult:
    """What the toy tool was called with."""

    values: dict[str, Any]

    def summary(self) -> dict[str, Any]:
        values = {name: _plain(value) for name, value in self.values.items()}
        return {"values": values, "verdict": {"check_rmse_px": 0.25, "reason": "good"}}

    def lines(self) -> list[str]:
        title = self.values.get("title")
        return ["accepted", f"size {self.values['size']}", *([title] if title else [])]


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, Path) else value


@tool(
    title="Toy tool",
    group="Toys",
    outputs=(
        Output("check_rmse_px", "Error at check points [px]", "verdict.check_rmse_px"),
        Output("reason", "Reason", "verdict.reason", text=True),
    ),
)
def toy(
    reference: Annotated[Path, RasterIn(label="Reference", help="The raster that stays.")],
    input: Annotated[Path, RasterIn(label="Input", help="The raster that moves.")],
    output: Annotated[Path, RasterOut(label="Output", help="What is written.")],
    size: Annotated[
        float, Number(label="Size", help="How large.", unit="px", minimum=1, maximum=9, option=True)
    ],
    search_radius: Annotated[
        float | None, Distance(label="Search radius", help="How far; by default from the data.")
    ] = None,
    mode: Annotated[
        str,
        Choice(label="Mode", help="What it does.", choices=("work", "refuse", "crash", "wait")),
    ] = "work",
    band: Annotated[int, Band(label="Band", help="Which band.", of="input")] = 1,
    careful: Annotated[bool, Flag(label="Careful", help="Look twice.")] = True,
    title: Annotated[str | None, Text(label="Title", help="Any words.")] = None,
    tie_points: Annotated[
        Path | None, VectorOut(label="Tie points", help="Points that were found.")
    ] = None,
    report: Annotated[
        Path | None, FileOut(label="Report", help="For people.", suffixes=(".html",))
    ] = None,
    folder: Annotated[Path | None, FolderOut(label="Folder", help="For more files.")] = None,
    regions: Annotated[
        Path | None, VectorIn(label="Regions", help="Where to look.", advanced=True)
    ] = None,
    transform: Annotated[
        Path | None,
        FileIn(label="Transform", help="Where to begin.", suffixes=(".json",), advanced=True),
    ] = None,
    mask: Annotated[
        Path | None, MaskIn(label="Mask", help="What takes part.", advanced=True)
    ] = None,
    others: Annotated[
        tuple[Path, ...] | None, RastersIn(label="Others", help="More of them.", advanced=True)
    ] = None,
    seed: Annotated[
        int, Number(label="Seed", help="For chance.", integer=True, minimum=0, advanced=True)
    ] = 7,
    workers: Annotated[
        int | None,
        Number(label="Workers", help="How many.", integer=True, minimum=1, maximum=9, common=True),
    ] = None,
    progress: Progress = SILENT,
) -> ToyResult:
    """Do what a tool does, without images.

    It writes its output only at the end,
    as all tools do.

    Returns
    -------
    ToyResult
        What it was called with.
    """
    values = {k: v for k, v in locals().items() if k not in ("progress", "workers", "mode")}
    progress.update(0.5, "half of it")
    if mode == "refuse":
        raise NotRegisteredError("refused: too few\npoints agree", ToyVerdict("too few"))  # type: ignore[arg-type]
    if mode == "crash":
        raise ZeroDivisionError("a bug")
    while mode == "wait":
        progress.check()
        time.sleep(0.01)
    with Outputs() as outputs:
        outputs.stage(output).write_bytes(b"done")
    progress.update(1.0)
    return ToyResult(values)


@tool(title="Toy that returns", group="Toys")
def returning_toy(
    input: Annotated[Any, RasterIn(label="Input", help="What is doubled.")],
    output: Annotated[
        Path | None,
        RasterOut(label="Output", help="What is written.", optional_in_python=True),
    ] = None,
    factor: Annotated[float, Number(label="Factor", help="How many times.")] = 2.0,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> ToyResult:
    """Do what a tool does that can return its result instead of writing it."""
    return ToyResult({"input": input, "output": output, "shown": dict(parameters)})


TOY: Tool = tool_of(toy)
RETURNING_TOY: Tool = tool_of(returning_toy)


def load_toy(name: str) -> Tool:
    """Return a toy by its name, also in another process."""
    return {tool.name: tool for tool in (TOY, RETURNING_TOY)}[name]


def run_tools(args: Sequence[str] | None, tools: Sequence[Tool]) -> int:
    """Run the command line with these tools instead of the package's."""
    by_name = {tool.name: tool for tool in tools}
    load = by_name.__getitem__
    with patch.multiple(cli, NAMES=tuple(by_name), load_tool=load, named_tool=load):
        return cli.main(args)


if __name__ == "__main__":
    sys.exit(run_tools(None, [TOY]))
