"""The way into the command line and out of it: exit codes and messages, for every command."""

from __future__ import annotations

import io
import os
import sys
import traceback
from collections.abc import Sequence
from typing import TYPE_CHECKING

from circuitkit.base.errors import CircuitkitError
from circuitkit.base.files import reason
from circuitkit.base.graphics import shut_out_settings_of_matplotlib
from circuitkit.base.signals import tidy_up_when_ended

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer

DONE = 0
RUN_FAILED = 3
INTERRUPTED = 130  # 128 + SIGINT, as shells report it
_STDOUT, _STDERR = 1, 2
PIPE_CLOSED = 141  # 128 + SIGPIPE, as shells report it


def entry_point() -> None:
    """Run the command line of this process and exit with its code; 143 if SIGTERM has ended it."""
    tidy_up_when_ended()
    _open_standard_streams()
    shut_out_settings_of_matplotlib()
    sys.exit(main())


class _Uncomplaining(io.FileIO):
    """Where messages go: if they cannot be written, nobody can be told."""

    def write(self, text: Buffer, /) -> int | None:  # type: ignore[override]  # None: as `io` documents it
        try:
            return super().write(text)
        except OSError:
            return memoryview(text).nbytes


def _open_standard_streams() -> None:
    """Have streams that can be written to, whatever they were closed or redirected to, and in UTF-8.

    A terminal has its own encoding, and without Greek letters it still shows the rest.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= _STDERR:  # or a result gets that number
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdout = sys.stdout or open(_STDOUT, "w", closefd=False)  # noqa: SIM115 - to the end
    if sys.stderr is None or sys.stderr is sys.__stderr__:
        encoding = None if sys.stderr is None else sys.stderr.encoding
        raw = io.BufferedWriter(_Uncomplaining(_STDERR, "w", closefd=False))
        sys.stderr = io.TextIOWrapper(raw, encoding, line_buffering=True, write_through=True)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            if stream.isatty():
                stream.reconfigure(errors="replace")
            else:
                stream.reconfigure(encoding="utf-8", errors="backslashreplace", newline="\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        arguments: What follows the word `circuitkit`; by default, what this process was called with.

    Returns:
        The exit code: 0 done, 1 the input is wrong, 2 wrong usage, 3 the run failed, 130 interrupted, 141 the
        reader of the output has gone.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words  # accepted before and after the name of the command
    try:
        code = _run_command([word for word in words if word != "--debug"])
    except KeyboardInterrupt as interruption:
        code = INTERRUPTED
        if kept := str(interruption):  # what is there, and how to go on
            print(kept, file=sys.stderr)
    except BrokenPipeError:
        code = PIPE_CLOSED
    except Exception as error:  # the last resort of a command line: no traceback reaches a user
        code = _report(error, debug)
    if code == INTERRUPTED:
        print("interrupted", file=sys.stderr)
    return _finish_output(code, debug)


def _run_command(words: list[str]) -> int:
    from typer.main import get_group  # here, so that Ctrl-C while commands are imported is one line, too

    from circuitkit.cli.app import app  # the same

    group = get_group(app)
    command = group.commands.get(words[0]) if words else None
    try:
        if (
            command is not None
        ):  # straight to it: to read options of the group, typer would import pydantic first
            command.main(args=words[1:], prog_name=f"circuitkit {command.name}", **group.context_settings)
        else:
            group.main(args=words, prog_name="circuitkit")
    except SystemExit as ending:
        if isinstance(ending.__context__, BrokenPipeError):
            return PIPE_CLOSED
        cause = ending.__context__
        while cause is not None and not isinstance(cause, KeyboardInterrupt):
            cause = cause.__cause__ or cause.__context__
        if cause is not None:  # it may say what is kept
            raise cause from None
        return ending.code if isinstance(ending.code, int) else DONE
    return DONE


def _report(error: Exception, debug: bool) -> int:
    """Print an error for a person and return the exit code."""
    if isinstance(error, CircuitkitError):
        text = str(error)
    elif isinstance(error, OSError):
        text = f"cannot use '{error.filename}': {reason(error)}" if error.filename else reason(error)
    elif isinstance(error, MemoryError):
        text = f"not enough memory: {error}"
    else:
        text = f"internal error: {type(error).__name__}: {error}; --debug shows where, please report it"
    if debug:
        traceback.print_exception(error)
    else:
        print(text, file=sys.stderr)
    return error.exit_code if isinstance(error, CircuitkitError) else RUN_FAILED


def _finish_output(code: int, debug: bool) -> int:
    """Write what is still buffered, and meet a reader that has gone or a full disk here."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        code = PIPE_CLOSED
    except OSError as error:
        code = _report(error, debug)
    else:
        return code
    os.dup2(
        os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()
    )  # or the interpreter complains when it ends
    return code
