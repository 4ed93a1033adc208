"""The list of the commands; `cli/__init__.py` says why they import late what they call."""

from __future__ import annotations

import importlib
import pkgutil
from operator import attrgetter
from types import ModuleType
from typing import Annotated

import typer

import circuitkit
from circuitkit import cli

# Without rich's markup the help is plain text and comes twice as fast.
app = typer.Typer(
    name="circuitkit",
    help="Neural circuits as data: check, draw and run them, alone or in closed loop with a simulated robot.",
    epilog="FILE and SCENARIO are paths, or names of shipped ones such as binn_lateral and nao_push. "
    "Exit codes: 0 done, 1 the input is wrong, 2 wrong usage, 3 the run failed, 130 Ctrl-C, 143 SIGTERM.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _commands() -> list[ModuleType]:
    """The modules beside this one that have `register`, in the order of their `PLACE`.

    Those with an underscore are parts of commands, which are imported when they are needed.
    """
    names = [each.name for each in pkgutil.iter_modules(cli.__path__)]
    chosen = [name for name in names if not name.startswith("_") and name not in {"app", "main"}]
    modules = [importlib.import_module(f"{cli.__name__}.{name}") for name in chosen]
    return sorted((each for each in modules if hasattr(each, "register")), key=attrgetter("PLACE"))


for _module in _commands():
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
