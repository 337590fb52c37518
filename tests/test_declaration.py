"""Declarations: what is read from a function, and how its values are checked."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster
from toys import RETURNING_TOY, TOY, returning_toy, toy

from groundtie.declaration import Output, Parameter, tool, tool_of
from groundtie.errors import MemoryLimitError, OutputError, ParameterError, SameFileError
from groundtie.kinds import Flag, MaskIn, Number, RasterIn, RasterOut, plain
from groundtie.progress import SILENT, Progress


@pytest.fixture
def needed(tmp_path: Path) -> dict[str, Any]:
    return {
        "reference": str(tmp_path / "a.tif"),
        "input": str(tmp_path / "b.tif"),
        "output": str(tmp_path / "c.tif"),
        "size": 3,
    }


def test_the_declaration_is_read_from_the_function() -> None:
    assert (TOY.name, TOY.title, TOY.group) == ("toy", "Toy tool", "Toys")
    assert TOY.summary == "Do what a tool does, without images."
    assert TOY.description == "It writes its output only at the end,\nas all tools do."
    assert [output.name for output in TOY.outputs] == ["check_rmse_px", "reason"]


def test_parameters_follow_the_signature_without_progress() -> None:
    signature = inspect.signature(toy).parameters
    names = [name for name in signature if name != "progress"]
    assert [p.name for p in TOY.all_parameters] == names
    for parameter in TOY.all_parameters:
        default = signature[parameter.name].default
        assert parameter.required == (default is inspect.Parameter.empty)
        assert parameter.default == (None if parameter.required else default)


def test_a_parameter_is_called_by_its_name_in_words_where_it_has_no_label() -> None:
    @tool(title="Named", group="Toys")
    def named(
        pixel_size: Annotated[int, Number(help="Size.")],
        more: Annotated[int, Number(label="Rest", help="Rest.")],
    ) -> Any:
        """Name things."""

    assert [p.kind.label for p in tool_of(named).parameters] == ["Pixel size", "Rest"]


def test_what_does_not_fit_into_memory_is_an_error_in_one_line() -> None:
    @tool(title="Large", group="Toys")
    def large(size: Annotated[int, Number(label="Size", help="Size.", integer=True)]) -> Any:
        """Take memory."""
        return np.empty((size, size, size))

    with pytest.raises(MemoryLimitError, match="memory does not suffice: Unable to allocate"):
        large(10**6)


def test_what_is_common_to_all_tools_is_no_parameter_of_one() -> None:
    assert [parameter.name for parameter in TOY.common] == ["workers"]
    assert "workers" not in {parameter.name for parameter in TOY.parameters}


def test_required_parameters_are_positional_unless_they_are_options() -> None:
    assert [p.name for p in TOY.parameters if p.positional] == ["reference", "input", "output"]
    assert TOY.parameter("size").required


def test_values_are_completed_and_typed(needed: dict[str, Any]) -> None:
    values = TOY.check({**needed, "search_radius": "12"})
    assert list(values) == [*(parameter.name for parameter in TOY.parameters), "workers"]
    assert values["reference"] == Path(needed["reference"])
    assert values["size"] == 3.0
    assert values["search_radius"] == 12.0
    assert values["mode"] == "work"
    assert values["seed"] == 7
    assert values["report"] is None


def test_none_takes_the_default(needed: dict[str, Any]) -> None:
    assert TOY.check({**needed, "seed": None})["seed"] == 7


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"size": None}, ParameterError, "size is missing"),
        ({"size": 10}, ParameterError, "size must be 1 to 9 px, not 10"),
        ({"colour": 1}, ParameterError, "toy has no parameter colour"),
        ({"input": "{a}"}, SameFileError, "input is the same raster as reference"),
        ({"output": "{a}"}, SameFileError, "output is the same file as reference"),
        ({"output": "/no/such/a.tif"}, OutputError, "the folder of output does not exist"),
    ],
)
def test_bad_values_are_refused(
    needed: dict[str, Any], change: dict[str, Any], error: type[Exception], message: str
) -> None:
    filled = {k: needed["reference"] if v == "{a}" else v for k, v in change.items()}
    with pytest.raises(error, match=message):
        TOY.check({**needed, **filled})


def test_messages_call_parameters_as_the_caller_does(needed: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=r"^<Size> must be 1 to 9 px"):
        TOY.check({**needed, "size": 0}, spell=lambda p: f"<{p.kind.label}>")
    with pytest.raises(SameFileError, match=r"^<Input> is the same raster as <Reference>"):
        TOY.check({**needed, "input": needed["reference"]}, spell=lambda p: f"<{p.kind.label}>")


def test_the_python_function_checks_too(needed: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match="seed must be at least 0, not -1"):
        toy(**needed, seed=-1)
    with pytest.raises(TypeError, match=r"^toy\(\) .*size"):
        toy("a.tif", "b.tif", "c.tif")  # type: ignore[call-arg, arg-type]
    assert not Path(needed["output"]).exists()


def test_help_shows_every_parameter_with_its_values() -> None:
    text = inspect.getdoc(toy) or ""
    for parameter in TOY.all_parameters:
        assert f"\n{parameter.name}" in text
        assert parameter.kind.help in text
    assert "\nsize : px, 1 to 9\n    How large.\n" in text
    assert "\nmode : work, refuse, crash, wait\n" in text


def test_the_python_function_runs_with_progress(needed: dict[str, Any]) -> None:
    seen: list[float] = []
    values = list(needed.values())
    result = toy(*values, progress=Progress(lambda fraction, message: seen.append(fraction)))
    assert seen == [0.5, 1.0, 1.0]  # the last by the declaration, whatever the tool reports
    assert result.values["output"] == Path(needed["output"])
    assert result.values["size"] == 3.0


def test_outputs_are_found_in_the_summary(needed: dict[str, Any]) -> None:
    summary = toy(**needed).summary()
    assert [output.value(summary) for output in TOY.outputs] == [0.25, "good"]
    with pytest.raises(KeyError):
        Output("x", "X", "verdict.no_such").value(summary)


def test_a_parameter_without_a_kind_is_a_mistake_of_ours() -> None:
    with pytest.raises(TypeError, match="wrong: parameter size has no kind"):

        @tool(title="Wrong", group="Toys")
        def wrong(size: int) -> Any:
            """Do nothing."""


def test_a_tool_needs_no_paragraphs_beyond_its_summary() -> None:
    @tool(title="Short", group="Toys")
    def short(fast: Annotated[bool, Flag(label="Fast", help="Fast.")] = False) -> Any:
        """Do little."""

    assert (tool_of(short).summary, tool_of(short).description) == ("Do little.", "")


def test_a_tool_may_ask_for_all_its_values_at_once() -> None:
    seen: dict[str, Any] = {}

    @tool(title="Curious", group="Toys")
    def curious(
        fast: Annotated[bool, Flag(label="Fast", help="Fast.")] = False,
        size: Annotated[float, Number(label="Size", help="Size.")] = 2,
        progress: Progress = SILENT,
        parameters: Mapping[str, Any] = MappingProxyType({}),
    ) -> Any:
        """Tell its values."""
        seen.update(parameters)

    curious(size=3)
    assert seen == {"fast": False, "size": 3.0}
    assert [p.name for p in tool_of(curious).parameters] == ["fast", "size"]
    assert list(inspect.signature(curious).parameters) == ["fast", "size", "progress"]
    with pytest.raises(ParameterError, match="curious has no parameter parameters"):
        curious(parameters={"fast": True})


def test_a_missing_value_is_named() -> None:
    raster = Parameter("input", RasterIn(label="Input", help="It."), required=True)
    with pytest.raises(ParameterError, match=r"^INPUT is missing$"):
        raster.check(None, "INPUT")
    number = Parameter("n", Number(label="N", help="It."), required=False)
    assert number.check(None, "n") is None


class TestResultsInMemory:
    """What Python's callers may hand over, and leave out."""

    def test_an_output_may_be_left_out_in_python_alone(self) -> None:
        parameter = RETURNING_TOY.parameter("output")
        assert parameter.required and parameter.positional
        assert RETURNING_TOY.check({"input": "a.tif"}, in_python=True)["output"] is None
        with pytest.raises(ParameterError, match=r"^output is missing$"):
            RETURNING_TOY.check({"input": "a.tif"})

    def test_an_array_is_handed_on_and_reported_by_its_size(self) -> None:
        values = np.zeros((40, 60))
        found = returning_toy(values).values
        assert found["input"].values is values
        assert found["output"] is None
        assert found["shown"] == {"input": found["input"], "output": None, "factor": 2.0}
        assert plain(found["shown"])["input"] == "array of 60 × 40 (input)"

    def test_an_open_dataset_is_handed_on_and_reported_by_its_name(self, tmp_path: Path) -> None:
        path = write_raster(tmp_path / "a.tif", np.zeros((4, 6)), utm_grid(6, 4))
        with rasterio.open(path) as dataset:
            found = returning_toy(dataset).values
            assert found["input"] is dataset
            assert plain(found["shown"])["input"] == str(path)
            with pytest.raises(SameFileError, match="output is the same file as input"):
                returning_toy(dataset, path)
            with pytest.raises(SameFileError, match="input is the same raster as reference"):
                toy(path, dataset, tmp_path / "c.tif", 3)

    def test_a_mask_may_be_an_array(self) -> None:
        held = MaskIn(label="Mask", help="It.").check("mask", np.zeros((4, 6), bool))
        assert str(held) == "array of 6 × 4 (mask)"

    def test_arrays_of_one_size_are_two_rasters(self, tmp_path: Path) -> None:
        one, other = np.zeros((40, 60)), np.zeros((40, 60))
        toy(one, other, tmp_path / "c.tif", 3)
        with pytest.raises(SameFileError, match="input is the same raster as reference: array of"):
            toy(one, one, tmp_path / "c.tif", 3)

    def test_what_may_be_left_out_has_no_default(self) -> None:
        with pytest.raises(TypeError, match="its default must be None"):

            @tool(title="Wrong", group="Toys")
            def wrong(
                output: Annotated[
                    Any, RasterOut(label="Output", help="It.", optional_in_python=True)
                ] = "a.tif",
            ) -> Any:
                """Do nothing."""
