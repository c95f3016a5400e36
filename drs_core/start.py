"""Where the command ``drs`` begins: Ctrl-C while it still imports its libraries ends it like later, quietly."""

from __future__ import annotations

import os
import signal


def main() -> None:
    """Run the command line; ends the process."""
    # nothing is there yet that would have to be cleaned up
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(128 + number))
    from drs_core import cli

    signal.signal(signal.SIGINT, signal.default_int_handler)
    cli.main()
