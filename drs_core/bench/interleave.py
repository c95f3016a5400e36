"""Turns: in every round each variant comes once, and who is first changes from round to round."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeVar

T = TypeVar("T")


def turns(names: Sequence[str], rounds: int) -> Iterator[tuple[int, str]]:
    """(round, name), round by round, the order rotated by one each round.

    A machine that is busy for a while then slows all of them, and nobody always follows the same one.
    """
    for index in range(rounds):
        first = index % len(names) if names else 0
        for name in (*names[first:], *names[:first]):
            yield index, name


def interleaved(
    jobs: Mapping[str, Callable[[int], T]], rounds: int, done: Callable[[], None] = lambda: None
) -> dict[str, list[T]]:
    """Run every job once a round, with the round's number; name -> its results in the order of rounds."""
    results: dict[str, list[T]] = {name: [] for name in jobs}
    for index, name in turns(tuple(jobs), rounds):
        results[name].append(jobs[name](index))
        done()
    return results
