"""`python -m circuitkit`: the same as the command `circuitkit`."""

from circuitkit.cli.main import entry_point

if __name__ == "__main__":
    entry_point()
