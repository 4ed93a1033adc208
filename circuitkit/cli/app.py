"""The list of the commands."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Annotated

import typer

import circuitkit
from circuitkit import cli

# Without rich's markup the help is plain text and comes twice as fast.
app = typer.Typer(
    name="circuitkit",
    help="Neural circuits as data: check, draw and run them, alone or in closed loop with a simulated robot.",
    epilog="FILE and SCENARIO are paths, or names of shipped ones such as binn_lateral and nao_push. "
    "Exit codes: 0 done, 1 the input is wrong, 2 wrong usage, 3 the run failed.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)

for _found in pkgutil.iter_modules(cli.__path__):  # every module with `register` is a command
    if _found.name not in {"app", "main"}:
        _module = importlib.import_module(f"{cli.__name__}.{_found.name}")
        if hasattr(_module, "register"):
            _module.register(app)

COMMANDS = tuple(
    command.name or command.callback.__name__ for command in app.registered_commands if command.callback
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"circuitkit {circuitkit.__version__}")
        raise typer.Exit


@app.callback()
def _common(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[
        bool,
        typer.Option("--debug", help="Show the traceback of an error; also after the name of a command."),
    ] = False,
) -> None:
    del version, debug  # the first has acted already, the second is read in `main`
