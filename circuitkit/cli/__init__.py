"""The command line. A command parses its arguments, calls one function and prints what comes back.

What every command has in common (exit codes, messages, Ctrl-C, broken pipes) is in `main`; the list of
commands is in `app`; how tables and JSON are printed is in `printing`.

Every `--help` takes less than 0.3 s, but numpy, pydantic, matplotlib and MuJoCo take up to a second to
import. So the modules of commands, all of which are imported for any help, import at their top only what is
light: the standard library, typer, each other, and `errors`, `files`, `progress` and `units` of `base`. A
command imports what it calls when it is called. What needs heavy modules throughout is in a module whose name
begins with an underscore, which a command imports late, too.
"""
