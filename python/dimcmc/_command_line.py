"""The command `dimcmc`."""

import signal
import sys

from . import _core


def main() -> None:
    """Run the command line of the program, and end with its exit code."""
    # Ctrl-C is the program's own to handle
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_core.command_line(["dimcmc", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
