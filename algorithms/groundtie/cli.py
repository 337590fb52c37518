"""The command line, made from the tools' declarations: `groundtie TOOL INPUTS… OUTPUT [--options]`.

Standard output carries the result alone. An error is one line on standard error and an exit code:
2 for bad input, 3 for a refused registration, 128 plus the signal's number when cancelled.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import shutil
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Any, TextIO

import click
from click.shell_completion import CompletionItem

from .declaration import Parameter, Tool
from .errors import (
    CancelledError,
    GroundTieError,
    NotRegisteredError,
    OutputError,
    ParameterError,
    one_line,
)
from .kinds import Choice, Flag, FolderOut, Kind, Number, PathKind, RastersIn
from .memory import DEFAULT_MB, VARIABLE, budget_bytes, set_heaps
from .packages import use_one_thread
from .progress import Progress
from .tools import NAMES, load_tool, named_tool
from .version import __version__

# A word of a message, with its parentheses, that is no part of a path or of a quoted text.
_WORD = re.compile(r"(?<![\w./\\'\"-])(?:\(\w+\)|\w+)(?![\w/\\'\"-]|\.\w)")


def main(args: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    args
        Arguments without the program's name (default: those of the process).

    Returns
    -------
    int
        The exit code.
    """
    with _open_streams():
        _silence_libraries()
        use_one_thread()
        set_heaps()
        return _run(args)


def _run(args: Sequence[str] | None) -> int:
    with _signals() as received:
        try:
            command = click.version_option(__version__, message="%(prog)s %(version)s")(ToolGroup())
            code = command.main(args, prog_name="groundtie", standalone_mode=False, obj=received)
        except click.ClickException as error:
            return _fail(_usage(error), error.exit_code)
        except (CancelledError, _SecondSignal) as error:
            number = received[0] if received else signal.SIGINT
            return _fail(str(error) or "cancelled", 128 + number)
        except GroundTieError as error:
            return _fail(error.one_line(), error.exit_code)
    return int(code or 0)


def _fail(message: str, exit_code: int) -> int:
    click.echo(f"groundtie: error: {message}", err=True)
    return exit_code


def _usage(error: click.ClickException) -> str:
    message = one_line(error.format_message())
    if isinstance(error, click.UsageError) and error.ctx is not None:
        message = f"{message.rstrip('.')} (see {error.ctx.command_path} --help)"
    return message


@contextmanager
def _open_streams() -> Iterator[None]:
    """Make standard streams take any text, so that printing cannot cost a result.

    A caller from Python has its own streams back afterwards, unchanged.
    """
    _take_numbers()
    with _open_stream(sys.stdout, redirect_stdout), _open_stream(sys.stderr, redirect_stderr):
        yield


def _take_numbers() -> None:
    """Occupy the descriptors, 0 to 2, of closed streams, or the next opened file would get one.

    Libraries' messages for standard error would then be written to that file.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free descriptor is this one.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)


@contextmanager
def _open_stream(stream: Any, redirect: Callable[[TextIO], Any]) -> Iterator[None]:
    """Discard text for a closed stream; escape characters that an open one cannot encode."""
    if _is_closed(stream):
        with open(os.devnull, "w", encoding="utf-8") as nowhere, redirect(nowhere):
            yield
    elif hasattr(stream, "reconfigure"):
        errors = stream.errors
        stream.reconfigure(errors="backslashreplace")
        try:
            yield
        finally:
            # This flushes, too: a full disk or a closed pipe has been reported already.
            with suppress(OSError, ValueError):
                stream.reconfigure(errors=errors)
    else:
        yield


def _is_closed(stream: Any) -> bool:
    try:
        return stream is None or getattr(stream, "closed", False)
    except ValueError:  # a stream without its buffer
        return True


def _silence_libraries() -> None:
    """Keep the messages of GDAL and OpenCV and Python's warnings off standard error.

    The tools raise errors of their own. `python -W`, `PYTHONWARNINGS`, `CPL_LOG` or
    `OPENCV_LOG_LEVEL` show those of the libraries.
    """
    os.environ.setdefault("CPL_LOG", os.devnull)  # GDAL's messages past rasterio
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
    logging.getLogger().addHandler(logging.NullHandler())  # GDAL's messages through rasterio
    if not sys.warnoptions:
        warnings.simplefilter("ignore")


class _SecondSignal(BaseException):
    """Ends the work at once; for a `KeyboardInterrupt`, click would print a line."""


@contextmanager
def _signals() -> Iterator[list[int]]:
    """Collect SIGINT and SIGTERM in a list, so that work ends at its next step and cleans up.

    A second signal does not wait for that step.
    """
    received: list[int] = []

    def handle(number: int, frame: object) -> None:
        if received:
            raise _SecondSignal
        received.append(number)

    previous = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


class ToolGroup(click.Group):
    """The command `groundtie`; a tool is loaded, with all that it imports, when it is needed."""

    def __init__(self) -> None:
        super().__init__(
            "groundtie",
            help="Register satellite images to one another.",
            invoke_without_command=True,
            callback=_before_command,
            params=[
                click.Option(
                    ["-v", "--verbose"],
                    is_flag=True,
                    help="Write what is decided, and why, to standard error.",
                ),
                click.Option(
                    ["--memory"],
                    metavar="MB",
                    help="Memory that a process is to take, as far as it can do with less; "
                    f"results do not depend on it.  [default: {DEFAULT_MB}]",
                ),
                click.Option(
                    ["--workers"],
                    metavar="INTEGER",
                    help="Number of threads, or of rows of a batch that run at the same time; it "
                    "may stand behind the tool's name, too.  [default: one per processor]",
                ),
            ],
            context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
        )
        self._names = {_command_name(name): name for name in NAMES}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the tools in the order in which they are declared."""
        return list(self._names)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command of a tool, by either spelling; None if there is no such tool."""
        name = self._names.get(_command_name(cmd_name))
        return None if name is None else ToolCommand(load_tool(name))

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands with this beginning, without loading them."""
        options = super().shell_complete(ctx, incomplete) if incomplete.startswith("-") else []
        return options + [
            CompletionItem(command, help=named_tool(name).summary)
            for command, name in self._names.items()
            if command.startswith(incomplete)
        ]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a line for each tool, without loading it."""
        rows = [(command, named_tool(name).summary) for command, name in self._names.items()]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def _command_name(tool: str) -> str:
    return tool.replace("_", "-")


@click.pass_context
def _before_command(
    context: click.Context, verbose: bool, memory: str | None, workers: str | None
) -> None:
    if context.invoked_subcommand is None:
        _print(context.get_help())
    if verbose:
        context.with_resource(_log_to(sys.stderr))
    if memory is not None:
        context.with_resource(_budget(memory))
    if workers is not None and context.invoked_subcommand is not None:
        # As if given after the tool's name; tools without workers do not ask for it.
        context.default_map = {context.invoked_subcommand: {"workers": workers}}


@contextmanager
def _budget(megabytes: str) -> Iterator[None]:
    """Set the memory budget of this process, and of those that it starts."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = megabytes
    try:
        budget_bytes()
        yield
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


@contextmanager
def _log_to(stream: TextIO) -> Iterator[None]:
    """Write the package's log to a stream, and the warnings of the libraries' logs."""
    handler = logging.StreamHandler(stream)
    handler.setFormatter(logging.Formatter("%(name)s: %(message)s"))
    own, root = logging.getLogger(__package__), logging.getLogger()
    level = own.level
    own.setLevel(logging.DEBUG)
    root.addHandler(handler)
    try:
        yield
    finally:
        root.removeHandler(handler)
        own.setLevel(level)


class ToolCommand(click.Command):
    """The command of one tool."""

    def __init__(self, tool: Tool) -> None:
        self.tool = tool
        super().__init__(
            _command_name(tool.name),
            help=f"{tool.summary}\n\n{tool.description}",
            params=[_click_parameter(parameter) for parameter in tool.all_parameters],
            callback=self._run,
        )
        self.params += [
            click.Option(["--json", "as_json"], is_flag=True, help="Print the result as JSON."),
            click.Option(["--quiet"], is_flag=True, help="Show no progress."),
        ]

    def _run(self, as_json: bool, quiet: bool, **values: Any) -> int:
        given = {name: value for name, value in values.items() if value is not None}
        checked = self.tool.check(given, spell=spelled)
        context = click.get_current_context()
        received, verbose = context.obj, context.find_root().params["verbose"]
        try:
            with _reporter(sys.stderr, quiet or verbose) as report:
                progress = Progress(report, is_cancelled=lambda: bool(received))
                result = self.tool.run(**checked, progress=progress)
        except NotRegisteredError as error:
            if as_json and error.verdict is not None:
                _print_json(error.summary())
            raise
        except ParameterError as error:
            raise ParameterError(_respelled(str(error), self.tool)) from error
        if as_json:
            _print_json(result.summary())
        else:
            _print("\n".join(result.lines()))
        return getattr(result, "exit_code", 0)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the arguments, the options, and then the options for experts."""
        sections: dict[str, list[tuple[str, str]]] = {
            title: [] for title in ("Arguments", "Options", "Advanced options")
        }
        for p in self.tool.all_parameters:
            option = "Advanced options" if p.kind.advanced else "Options"
            sections["Arguments" if p.positional else option].append((_synopsis(p), _describe(p)))
        own = self.get_params(ctx)[len(self.tool.all_parameters) :]
        sections["Options"] += filter(None, (option.get_help_record(ctx) for option in own))
        for title, rows in sections.items():
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def _click_parameter(parameter: Parameter) -> click.Parameter:
    """Return a parameter as click reads it, as text that the tool checks."""
    name, flag, kind = parameter.name, spelled(parameter), parameter.kind
    if isinstance(kind, Flag):
        return click.Option([f"{flag}/--no-{flag[2:]}", name], default=parameter.default)
    asked: dict[str, Any] = {"required": parameter.required, "shell_complete": _completions(kind)}
    if not parameter.positional:
        return click.Option([flag, name], **asked)
    if isinstance(kind, RastersIn):
        return click.Argument([name], nargs=-1, metavar=f"{flag}…", **asked)
    return click.Argument([name], metavar=flag, **asked)


def _completions(kind: Kind) -> Callable[..., list[CompletionItem]]:
    """Return a function that offers a value's words, or has the shell offer files or folders."""

    def offered(
        ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        if isinstance(kind, Choice):
            return [CompletionItem(word) for word in kind.choices if word.startswith(incomplete)]
        if isinstance(kind, (PathKind, RastersIn)):
            shown = "dir" if isinstance(kind, FolderOut) else "file"
            return [CompletionItem(incomplete, type=shown)]
        return []

    return offered


def spelled(parameter: Parameter) -> str:
    """Return how the command line spells a parameter: `REFERENCE`, `--search-radius`."""
    name = parameter.name.replace("_", "-")
    return name.upper() if parameter.positional else f"--{name}"


def _respelled(message: str, tool: Tool) -> str:
    """Return a tool's message with its parameters spelled as the command line spells them.

    A name of a single word is also a word of the language, unless it stands in parentheses.
    """
    names = {p.name: spelled(p) for p in tool.all_parameters}
    names = {name: text for name, text in names.items() if "_" in name} | {
        f"({name})": f"({text})" for name, text in names.items()
    }
    return _WORD.sub(lambda found: names.get(found[0], found[0]), message)


def _metavar(kind: Kind) -> str:
    if isinstance(kind, Choice):
        return f"[{'|'.join(kind.choices)}]"
    if isinstance(kind, Number):
        return "INTEGER" if kind.integer else "NUMBER"
    if isinstance(kind, PathKind):
        return "FOLDER" if isinstance(kind, FolderOut) else "FILE"
    return type(kind).__name__.upper()


def _synopsis(parameter: Parameter) -> str:
    flag = spelled(parameter)
    if parameter.positional:
        return flag
    if isinstance(parameter.kind, Flag):
        return f"{flag} / --no-{flag[2:]}"
    return f"{flag} {_metavar(parameter.kind)}"


def _describe(parameter: Parameter) -> str:
    notes = []
    if isinstance(parameter.kind, Choice) and parameter.positional:
        notes.append("|".join(parameter.kind.choices))
    if isinstance(parameter.kind, Number):
        notes += [note for note in (parameter.kind.unit, parameter.kind.range_text) if note]
    if isinstance(parameter.kind, Flag):
        notes.append(f"default: {'yes' if parameter.default else 'no'}")
    elif parameter.default is not None:
        notes.append(f"default: {parameter.default}")
    if parameter.required and not parameter.positional:
        notes.append("required")
    return f"{parameter.kind.help}  [{'; '.join(notes)}]" if notes else parameter.kind.help


def _print_json(values: dict[str, Any]) -> None:
    # NaN and infinity are not JSON: better no result than one that other programs cannot read
    _print(json.dumps(values, indent=2, allow_nan=False))


def _print(text: str) -> None:
    """Write a text to standard output.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    try:
        click.echo(text)
    except OSError as error:
        if error.errno == errno.EPIPE:
            raise  # the reader has closed the pipe: click ends the program
        # At exit, Python would try once more to write the rest.
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
        raise OutputError(f"cannot write to standard output: {error.strerror or error}") from error


@contextmanager
def _reporter(stream: TextIO, quiet: bool) -> Iterator[Callable[[float, str], None]]:
    """Show progress on one line of a terminal; show nothing elsewhere."""
    if quiet or not stream.isatty():
        yield lambda fraction, message: None
        return
    last = ""

    def report(fraction: float, message: str) -> None:
        nonlocal last
        last = message or last
        line = f"{fraction:4.0%} {last}"[: shutil.get_terminal_size().columns - 1]
        stream.write(f"\r{line}\x1b[K")
        stream.flush()

    try:
        yield report
    finally:
        stream.write("\r\x1b[K")
        stream.flush()
