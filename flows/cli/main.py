"""The command line ``motion-memory``: its commands, its exit codes, and how it reports errors and Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, Final, get_args

from cyclopts import App, CycloptsError, Group, Parameter, convert
from cyclopts.config import Toml
from cyclopts.exceptions import UnusedCliTokensError

from flows.cli import library_commands as libraries
from flows.cli import map_commands as maps
from flows.cli import problem_commands as problems
from flows.cli import result_commands as results
from flows.cli import retraining_commands as operations
from flows.cli import server_commands as serving
from flows.cli import stage_commands as stages
from flows.cli.configuration import check_configuration, configuration_file
from flows.cli.document import Document
from flows.cli.terminal import notices_shown, telling, to_output, write_document, write_error
from tasks.settings.errors import one_line
from tasks.settings.redaction import redacted

FAILURE: Final = 1
WRONG_USE: Final = 2
INTERRUPTED: Final = 130
SERVERS: Final = {"dashboard", "serve", "serve-memory", "servers"}  # commands that run until Ctrl-C
STARTING_OVER: Final = {"optimise", "plan", "route"}  # commands with a single answer
GRACE_SECONDS: Final = 2.0  # after Ctrl-C, to inform the server and stop the workers


def package_version() -> str:
    """The versions to name in a bug report: Motion Memory, Python and the main libraries."""
    import platform
    from importlib.metadata import version

    libraries = ", ".join(f"{name} {version(name)}" for name in ("prefect", "mlflow", "numba"))
    return f"motion-memory {version('motion-memory')} (Python {platform.python_version()}, {libraries})"


def _converted(type_: Any, tokens: Any) -> Any:
    """The value of an option; without this, cyclopts rounds a fraction where a whole number is wanted.

    It also refuses an empty text, as of a variable that is not set: as a path it would be the folder here.
    """
    if any(not token.value for token in tokens):
        raise ValueError("an empty text is no value; give one, or leave it out")
    if _holds_whole_numbers(type_):
        for token in tokens:
            if "." in token.value:
                raise ValueError(f"{token.value} is no whole number; give one")
    return convert(type_, tokens)


def _holds_whole_numbers(type_: Any) -> bool:
    return type_ is int or any(map(_holds_whole_numbers, get_args(type_)))


app = App(
    default_parameter=Parameter(converter=_converted),
    name="motion-memory",
    help="Plan robot motions from experience: collect, learn, recall, measure.",
    version=package_version,
    suppress_keyboard_interrupt=False,
)
for command in (
    *(stages.run, stages.collect, stages.hallucinate, stages.train, stages.build_memory, stages.benchmark),
    *(stages.report, stages.sweep, stages.experience_curve),
    *(problems.draw, problems.plan, problems.optimise, problems.solve),
    *(maps.import_worlds, maps.gather, maps.adapt, maps.route),
    *(results.verify, results.export, results.compare, serving.dashboard),
    *(serving.serve_memory, serving.servers),
    *(operations.retrain, operations.serve, operations.promote, operations.rollback),
    *(libraries.retrain_library, libraries.serve_library),
):
    app.command(command)
app.register_install_completion_command(add_to_startup=False)
app.meta.group_parameters = Group("Output of every command", sort_key=9)
Flag = Annotated[bool, Parameter(negative=(), show_default=False)]


@app.meta.default
def with_output(
    *tokens: Annotated[str, Parameter(show=False, allow_leading_hyphen=True, converter=convert)],
    json: Flag = False,
    quiet: Flag = False,
    verbose: Flag = False,
) -> Any:
    """Run a command with the requested kind of output.

    Args:
        tokens: The command and its own options.
        json: Write one JSON document with all tables, lines and files to the output, and nothing else.
        quiet: Write no progress and no notices; results, warnings and errors stay.
        verbose: Also say how many chunks each stage did and reused, and where in the code an error arose.
    """
    told = telling()
    told.document, told.quiet, told.verbose = Document() if json else None, quiet, verbose
    return app(tokens, exit_on_error=False, print_error=False, result_action="return_value")


def call(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code; a failure prints one line to the error stream."""
    with notices_shown():
        code = _call(sys.argv[1:] if arguments is None else arguments)
        write_document(code)
    return code


def _call(arguments: Sequence[str]) -> int:
    try:
        _refuse_null_characters(arguments)
        configured = configuration_file(Path.cwd())
        if configured is not None:
            check_configuration(configured, [name for name in app if not name.startswith("-")])
        app.config = () if configured is None else (Toml(configured),)
        code = app.meta(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except KeyboardInterrupt:
        return INTERRUPTED
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else FAILURE
    except Exception as error:
        if telling().verbose or os.environ.get("MOTION_MEMORY_DEBUG") == "1":
            print(redacted(traceback.format_exc()), file=sys.stderr)
        write_error(_one_line(error))
        return WRONG_USE if _is_wrong_use(error) else FAILURE
    return code if isinstance(code, int) else 0


def _refuse_null_characters(arguments: Sequence[str]) -> None:
    """Raise UsageError if an argument contains a null character, which would end a path for the system."""
    for argument in arguments:
        if "\0" in argument:
            from tasks.settings.errors import UsageError

            raise UsageError(
                f"{argument!r} contains a null character, which no path or name can; leave it out."
            )


def _is_wrong_use(error: Exception) -> bool:
    from tasks.settings.errors import UsageError

    return isinstance(error, CycloptsError | UsageError)


def _one_line(error: Exception) -> str:
    if isinstance(error, UnusedCliTokensError):
        return redacted(
            f"too many arguments: {' '.join(error.unused_tokens or ())}; leave them out, or write their "
            "option before each, as in --worlds A --worlds B."
        )
    return one_line(error)


def _open_closed_streams() -> None:
    """Open the streams that the caller has closed (``>&-``), before a file is opened under their numbers."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115  # as long as the process


def main() -> None:
    """Entry point of the console script."""
    _open_closed_streams()
    signal.signal(signal.SIGINT, _interrupt)
    code = FAILURE
    with suppress(OSError):  # of the error stream: nothing can be told then
        try:
            code = call()
            with to_output():
                pass  # what others have printed is written
        except OSError as error:
            code = FAILURE
            if not isinstance(error, BrokenPipeError):  # whose reader, such as `head`, wants no more
                write_error(_one_line(error))
        sys.stderr.flush()
    os._exit(code)  # threads of Prefect and Dask would wait for servers that have already ended


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    """Stop cleanly, but force an exit after ``GRACE_SECONDS`` if something hangs."""
    forced_exit = threading.Timer(GRACE_SECONDS, os._exit, [INTERRUPTED])
    forced_exit.daemon = True
    forced_exit.start()
    command = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
    told = "Interrupted. Repeat the command to continue where it stopped."
    if command in SERVERS:
        told = "Stopped."
    elif command in STARTING_OVER:
        told = "Interrupted. Nothing was kept: repeat the command to start over."
    print(told, file=sys.stderr)
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
