"""One target, many inputs, in a process of its own: python -m tests.fuzz.campaign TARGET --inputs N --minutes M."""

from __future__ import annotations

import argparse
import codecs
import json
import sys
import tempfile
import time
import traceback
from pathlib import Path

from drs_core.errors import DrsError
from tests.fuzz.guards import TooSlow, Watch, limit_memory, peak_mb, time_limit
from tests.fuzz.seeds import rng_of
from tests.fuzz.targets import TARGETS, Target

LONGEST_MESSAGE = 1500
MOST_FINDS = 20


def main() -> None:
    """Run, and print one JSON object: inputs, how many were taken and refused, finds, and what it cost."""
    options = argparse.ArgumentParser()
    options.add_argument("target")
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--first", type=int, default=0, help="number of the first input")
    options.add_argument("--inputs", type=int, default=sys.maxsize)
    options.add_argument("--minutes", type=float, default=1e9)
    given = options.parse_args()
    sys.dont_write_bytecode = True
    with tempfile.TemporaryDirectory(prefix="drs-fuzz-") as folder:
        tempfile.tempdir = folder
        inner = Path(folder) / "target"
        inner.mkdir()
        target = target_of(given.target)(inner)
        try:
            print(json.dumps(campaign(target, Path(folder), given)))
        finally:
            target.close()
            tempfile.tempdir = None


def target_of(name: str) -> type[Target]:
    """The target of a name; that of the messages needs ROS 2."""
    if name == "messages":
        from tests.fuzz.wild_messages import Messages

        return Messages
    return TARGETS[name]


def campaign(target: Target, folder: Path, given: argparse.Namespace) -> dict[str, object]:
    """Try inputs until one of the bounds is reached."""
    target.valid()
    # what the standard library imports late, by itself
    for name in (
        "raw_unicode_escape",
        "latin-1",
        *(f"utf-{bits}{end}" for bits in (16, 32) for end in ("", "-le", "-be")),
    ):
        codecs.lookup(name)
    watch, taken, finds, count = Watch(folder), 0, list[dict[str, object]](), 0
    limit_memory()
    begun_s = time.monotonic()
    worst_s, end_s = 0.0, begun_s + 60.0 * given.minutes
    while count < given.inputs and time.monotonic() < end_s and len(finds) < MOST_FINDS:
        before_s = time.process_time()
        found, fine = attempt(target, given.seed, given.first + count, watch)
        worst_s = max(worst_s, time.process_time() - before_s)
        taken += fine
        if found:
            finds.append({"input": given.first + count, "seed": given.seed, "find": found})
        count += 1
    return {
        "target": given.target,
        "inputs": count,
        "taken": taken,
        "refused": count - taken - len(finds),
        "finds": finds,
        "slowest_s": round(worst_s, 3),
        "peak_mb": round(peak_mb()),
        "wall_s": round(time.monotonic() - begun_s, 1),
    }


def attempt(target: Target, seed: int, index: int, watch: Watch) -> tuple[str, bool]:
    """What is wrong with how one input was met, or nothing; and whether it was taken."""
    found, fine = "", False
    try:
        with time_limit():
            target.attempt(rng_of(seed, index))
        fine = True
    except DrsError as error:
        found = wrong_message(str(error))
    except (Exception, TooSlow):
        found = traceback.format_exc()[-3000:]
    touched = watch.take()
    return "\n".join(filter(None, [found, *touched])), fine and not touched


def wrong_message(text: str) -> str:
    """Why a message is not fit to be shown: too long, or with characters that a terminal takes for commands."""
    if not 0 < len(text) <= LONGEST_MESSAGE:
        return f"a message of {len(text)} characters: {text[:300]!r}"
    strange = sorted({character for character in text if not (character.isprintable() or character == "\n")})
    return f"a message with {strange[:5]}: {text[:300]!r}" if strange else ""


if __name__ == "__main__":
    main()
