"""The command line. A command parses its arguments, calls one function and prints what comes back.

What every command has in common (exit codes, messages, Ctrl-C, broken pipes) is in `main`; the list of
commands is in `app`; how tables and JSON are printed is in `printing`. Heavy imports stand inside the
commands, so that `--help` is fast.
"""
