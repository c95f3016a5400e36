"""``drs record`` and ``drs replay``: their options, and what they print."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from typing import Annotated, Any

import typer

from drs_core.errors import DrsError, UsageError
from drs_core.files import check_writable
from drs_core.options import AgentName, Json

SUFFIX = ".mcap"


def record(
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write, *.mcap.")],
    topics: Annotated[
        str | None, typer.Option(help="Whole names or patterns with commas between. [default: all but hidden ones]")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Stop after so long. [default: at Ctrl-C]")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")] = False,
    as_json: Json = False,
) -> None:
    """Write the topics of a ROS 2 graph to an MCAP file, until Ctrl-C. Foxglove and PlotJuggler open it."""
    from drs_core.graph import node_process
    from drs_core.recording.reader import contents
    from drs_core.reporting.console import printer
    from drs_core.reporting.tables import plain_table

    if output.suffix != SUFFIX:
        raise UsageError(f"A recording is called *{SUFFIX}, not {output.name}.")
    if seconds is not None and not 0.0 < seconds <= 1e7:
        raise UsageError(f"--seconds is {seconds}; allowed are more than 0, to 1e7.")
    check_writable(output, force)
    settings: dict[str, Any] = {"output": str(output.absolute()), "seconds": float(seconds or 0.0)}
    if topics is not None:
        settings["topics"] = topics
    with printer(as_json) as out:
        command, environment = node_process("recorder_node", settings)
        # in a session of its own, so that Ctrl-C reaches it once
        status = _wait(subprocess.Popen(command, env=environment, stdout=2, start_new_session=True))
        if status:
            raise DrsError(f"The recorder ended with status {status}; what it said stands above.")
        found = contents(output)
        counts = [(topic.name, topic.kind, count) for topic, count in sorted(found.counts.items(), key=str)]
        out.show(
            {
                "output": str(output),
                "duration_s": found.duration_s,
                "topics": [{"topic": name, "type": kind, "messages": count} for name, kind, count in counts],
            },
            plain_table(
                f"{output}: {found.duration_s:.1f} s",
                ("topic", "type", "messages"),
                [(name, kind, str(count)) for name, kind, count in counts],
            ),
        )


def _wait(process: subprocess.Popen[bytes]) -> int:
    """Its exit status; Ctrl-C and SIGTERM are for the recorder, which then writes the end of the file."""

    def pass_on(number: int, frame: object) -> None:
        process.send_signal(signal.SIGINT)

    before = {number: signal.signal(number, pass_on) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        return process.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def replay(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="MCAP file of drs record or ros2 bag.")],
    agent: AgentName,
    topic: Annotated[str | None, typer.Option(help="Topic of the observations, where there are several.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw both actions over time: .png, .svg or .pdf.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the figure if it exists.")] = False,
    as_json: Json = False,
) -> None:
    """Show an agent the observations of a recording, and print how its actions differ from the recorded ones."""
    from drs_core.importing import resolve
    from drs_core.recording.figure import action_figure
    from drs_core.recording.replay import replay as run_replay
    from drs_core.recording.replay import summary
    from drs_core.reporting.console import printer
    from drs_core.reporting.figures import check_figure_file

    if figure is not None:
        check_figure_file(figure)
        check_writable(figure, force)
    with printer(as_json) as out:
        loaded = resolve(agent)
        result = run_replay(recording, loaded, topic)
        figures = {"recording": str(recording), "agent": agent, **summary(result)}
        lines = []
        if figure is not None:
            action_figure(result, figure)
            figures["figure"] = str(figure)
            lines.append(f"Figure: {figure}")
        out.show(figures, *_sentences(figures), *lines)


def _sentences(found: dict[str, Any]) -> list[str]:
    lines = [
        f"{found['recording']}: {found['actions']} actions answer observations on {found['topic']}; "
        f"{found['agent']} would have done the same in {found['equal']} of them, bit for bit."
    ]
    if found["equal"] < found["actions"]:
        by_action = ", ".join(f"{value:.3g}" for value in found["difference_mean_by_action"])
        lines.append(
            f"Differences: {found['difference_mean']:.3g} on average ({by_action} of each action), "
            f"at most {found['difference_max']:.3g}, {found['difference_max_at_s']:.2f} s after the first."
        )
    if found["action_change_recorded"] is not None:
        lines.append(
            f"Action change: {found['action_change_recorded']:.4f} as recorded, "
            f"{found['action_change_replayed']:.4f} of {found['agent']} on the same observations."
        )
    if found["unanswered"]:
        lines.append(f"{found['unanswered']} observations have no recorded action.")
    if not found["complete"]:
        lines.append("The recording breaks off: whoever wrote it was killed.")
    return lines
