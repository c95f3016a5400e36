"""Compile the helper where it is."""

import sys

from drs_core.accelerator.build import NotBuilt, build

try:
    print(build())
except NotBuilt as reason:
    sys.exit(f"Not built: {reason}.")
