"""What Ray sends to a worker as code and not by name: the look at the worker's drs, before anything of it is used."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from drs_core import __version__


def worker_entry() -> Callable[..., Any]:
    """The function of a task: the batch's `Answer`, or a sentence on why this worker cannot take part.

    Made here because Ray sends the code of such a function. Of one that a module holds it sends the name, and the
    worker would run its own: with another version, another search, or a failure that says nothing of the cause.
    For the same reason its batch is strings and numbers, and its agent a list of one reference, which Ray leaves alone.
    """
    expected = __version__

    # without annotations: their names would be looked up in the worker's drs
    def run_batch(agent, batch, theta):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        import socket
        from functools import partial

        where, mend = f"The worker on {socket.gethostname()}", "install the same on every machine of the cluster"
        try:
            import drs_core

            found = f"drs {drs_core.__version__} ({drs_core.__path__[0]})"
            if drs_core.__version__ != expected:
                return f"{where} has {found}, and this run is of drs {expected}: {mend}."
        except (ImportError, AttributeError) as error:
            return f"{where} has no drs that says its version ({error}), and this run is of drs {expected}: {mend}."
        try:
            import ray

            from drs_core.ray_rollouts.messages import Batch
            from drs_core.ray_rollouts.worker import run_batch

            return run_batch(Batch.of(batch), partial(ray.get, agent[0]), theta)
        except Exception as error:  # run_batch raises none: what it is asked for is not what it knows
            why = f"{type(error).__name__}: {str(error)[:80]}"
            return f"{where} has other code of {found} than this run ({why}): {mend}."

    return run_batch
