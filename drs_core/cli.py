"""The command line, ``drs``: reads arguments, calls the library, prints. Nothing is computed here."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from drs_core import __version__
from drs_core.errors import DrsError, UsageError, install
from drs_core.files import check_output, check_writable
from drs_core.streams import fail, prepare_streams

try:
    import typer
except ModuleNotFoundError:
    sys.exit(f"drs: the command line needs typer; {install('cli')}")

from drs_core.bench.command import bench
from drs_core.options import AgentName, Backend, Episodes, Json, Seed, Workers, folder_named, worker_count
from drs_core.recording.command import record, replay
from drs_core.report.command import report
from drs_core.reproduce.command import reproduce
from drs_core.signals import terminated_like_interrupted
from drs_core.training.command import train

if TYPE_CHECKING:
    from rich.console import Console

    from drs_core.agent import Agent
    from drs_core.evaluation import Evaluation
    from drs_core.reporting.console import Printer
    from drs_core.run_settings import RunSettings
    from drs_core.where import MakeRollouts

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # help in colour would cost a tenth of a second
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _say_version(wanted: bool) -> None:
    if wanted:
        print(f"drs {__version__}")
        raise typer.Exit


@app.callback()
def root(
    _: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Fine-tune reinforcement-learning policies by direct random search."""


def _printer(as_json: bool) -> AbstractContextManager[Printer]:
    from drs_core.reporting.console import printer

    return printer(as_json)


def _messages() -> Console:
    from drs_core.reporting.console import messages

    return messages()


@app.command("import")
def import_command(
    source: Annotated[str, typer.Argument(metavar="SOURCE", help="SB3 .zip, zoo folder or hf:org/name.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Agent file to write, *.safetensors.")],
    env: Annotated[str | None, typer.Option(help="Environment id, where the files do not state it.")] = None,
    algo: Annotated[str | None, typer.Option(help="Algorithm, where the files do not state it.")] = None,
    vecnormalize: Annotated[Path | None, typer.Option(help="vecnormalize.pkl, where it lies elsewhere.")] = None,
    time_feature: Annotated[
        bool | None,
        typer.Option(help="Whether it was trained in a TimeFeatureWrapper, where the files do not state it."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the output file if it exists.")] = False,
    as_json: Json = False,
) -> None:
    """Turn a Stable-Baselines3 agent into an agent file. Nothing in it is executed."""
    from drs_core.importing import Hints, import_agent
    from drs_core.reporting.tables import observed_line

    check_output(output, force)
    with _printer(as_json) as out:
        agent = import_agent(source, Hints(env, algo, vecnormalize, time_feature))
        agent.save(output)
        result = {"output": str(output), "environment": agent.environment, "parameters": len(agent.theta)}
        seen = {"normalised": agent.pipeline.normalised, "time_feature": agent.pipeline.time_limit_steps is not None}
        out.show(
            result | seen | {"source": dict(agent.source)},
            f"{output}: {agent.source['algorithm']} agent for {agent.environment}, {len(agent.theta)} parameters.",
            observed_line(**seen),
        )


@app.command()
def evaluate(
    agent: AgentName,
    episodes: Episodes = 100,
    seed: Seed = 0,
    workers: Workers = None,
    backend: Backend = "python",
    as_json: Json = False,
) -> None:
    """Run an agent many times and print what it achieves."""
    from drs_core.accelerator import choose
    from drs_core.evaluation import summary
    from drs_core.importing import resolve
    from drs_core.reporting.tables import evaluation_table

    with _printer(as_json) as out:
        loaded = resolve(agent)
        in_force = choose(backend, loaded)
        result = summary(_evaluate(agent, loaded, episodes, seed, workers, in_force))
        result["backend"] = in_force
        rates = f"{result['rollouts_per_second']:.1f} rollouts/s, {result['steps_per_second']:.0f} steps/s"
        out.show(result, evaluation_table(result), rates)


def _evaluate(name: str, agent: Agent, episodes: int, seed: int, workers: int | None, backend: str) -> Evaluation:
    import scipy.stats  # noqa: F401 - needed at the end, and better missed now

    from drs_core.evaluation import check_seeds
    from drs_core.evaluation import evaluate as run_evaluation
    from drs_core.reporting.progress import EpisodeProgress
    from drs_core.rollouts import local

    check_seeds(episodes, seed)
    pool = local(agent, min(worker_count(workers), episodes), backend)
    with closing(pool), EpisodeProgress(_messages(), name, episodes) as bar:
        return run_evaluation(name, agent, pool, episodes, seed, bar)


@app.command()
def compare(
    before: Annotated[str, typer.Argument(metavar="BEFORE", help="An agent.")],
    after: Annotated[str, typer.Argument(metavar="AFTER", help="Another agent of the same environment.")],
    episodes: Episodes = 100,
    seed: Seed = 0,
    workers: Workers = None,
    backend: Backend = "python",
    figure: Annotated[
        Path | None,
        typer.Option(
            help="Draw the tip's motion (Panda) in the episode that shakes as much as the median: .png, .svg or .pdf."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the figure if it exists.")] = False,
    as_json: Json = False,
) -> None:
    """Run two agents on the same seeds: is the second better?"""
    from drs_core.accelerator import choose
    from drs_core.evaluation import comparison, typical_seed
    from drs_core.importing import resolve
    from drs_core.reporting.figures import check_figure
    from drs_core.reporting.tables import comparison_sentence, comparison_table

    names = (before, after)
    agents = [resolve(name) for name in names]
    ids = [agent.environment for agent in agents]
    if ids[0] != ids[1]:
        raise UsageError(f"{before} is of {ids[0]}, {after} of {ids[1]}: compare two agents of one environment.")
    if figure:
        check_figure(figure, ids[0])
        check_writable(figure, force)
    with _printer(as_json) as out:
        for loaded in agents:
            # one for both, so that they differ in nothing else
            backend = choose(backend, loaded)
        pair = [_evaluate(*each, episodes, seed, workers, backend) for each in zip(names, agents, strict=True)]
        result = comparison(*pair) | {"backend": backend}
        if figure:
            _draw(agents, typical_seed(pair[0]), figure, backend)
            result["figure"] = str(figure)
        lines = [f"Figure: {figure}"] if figure else []
        out.show(result, comparison_table(result), comparison_sentence(result), *lines)


def _draw(agents: list[Agent], seed: int, figure: Path, backend: str) -> None:
    from drs_core.episode import TRAJECTORY
    from drs_core.reporting.figures import tip_motion_figure
    from drs_core.rollouts import InProcess, Task

    episodes = []
    for agent in agents:
        with closing(InProcess(agent, backend)) as rollouts:
            episodes += rollouts.run(agent.theta, [Task(seed, frozenset({TRAJECTORY}))])
    tip_motion_figure(episodes[0], episodes[1], figure)


@app.command()
def tune(
    agent: AgentName,
    output: Annotated[
        Path,
        typer.Option(parser=folder_named, metavar="PATH", help="Run folder to make or, with --resume, to continue."),
    ],
    params: Annotated[Path | None, typer.Option(help="Parameter file (see params/); options win over it.")] = None,
    updates: Annotated[int | None, typer.Option(help="K, updates of the whole schedule. [default: 200]")] = None,
    budget: Annotated[
        str | None, typer.Option(help="Robot time in place of --updates, such as 90s, 20min or 1h30min.")
    ] = None,
    reset_seconds: Annotated[float | None, typer.Option(help="Time between episodes, for --budget. [0]")] = None,
    stop_after: Annotated[int | None, typer.Option(help="Stop when this many updates are done.")] = None,
    stop_when_flat: Annotated[bool | None, typer.Option(help="Stop when evaluations have gone flat. [no]")] = None,
    directions: Annotated[int | None, typer.Option(help="n, directions an update, two rollouts each. [64]")] = None,
    objective: Annotated[str | None, typer.Option(help="return, dimension or smooth. [default: return]")] = None,
    smoothness_weight: Annotated[
        float | None, typer.Option(help="c of smooth. [default: from the agent's own figures]")
    ] = None,
    alpha: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Step size, first and last. [0.02 0.002; smooth: 0.02 0.01; gains: 0.1 0.05]"),
    ] = None,
    sigma: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Noise, first and last. [0.025 0.0025; smooth: 0.025 0.0125; gains: 0.15 0.075]"),
    ] = None,
    last_layer: Annotated[bool | None, typer.Option(help="Tune only the last layer. [default: all]")] = None,
    action_gains: Annotated[bool | None, typer.Option(help="Tune only the gain of each action. [default: all]")] = None,
    top: Annotated[int | None, typer.Option(help="b, directions that count, the best ones. [0: all]")] = None,
    paired_spread: Annotated[
        bool | None, typer.Option(help="Divide a step by the spread within pairs, not that of all. [default: no]")
    ] = None,
    back_off: Annotated[
        bool | None, typer.Option(help="Where it gets lost, back to the best agent with shorter steps. [default: no]")
    ] = None,
    evaluate_every: Annotated[int | None, typer.Option(help="Updates between evaluations, 0 for none. [10]")] = None,
    evaluation_episodes: Annotated[int | None, typer.Option(help="Episodes of an evaluation. [20]")] = None,
    attempts: Annotated[int | None, typer.Option(help="Runs of a pair that is broken off, at most. [3]")] = None,
    action_change_max: Annotated[
        float | None, typer.Option(help="Lower sigma where a candidate would change an action by more. [0: no cap]")
    ] = None,
    observations: Annotated[
        Path | None, typer.Option(help="Recording that the cap is judged on, *.mcap. [default: simulated episodes]")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the search. [default: 0]")] = None,
    workers: Workers = None,
    backend: Annotated[str | None, typer.Option(help="What runs the episodes, as in evaluate. [python]")] = None,
    rollouts: Annotated[str, typer.Option(help="Where episodes run: local or ray.")] = "local",
    ray: Annotated[Path | None, typer.Option(help="YAML file: which Ray cluster, and what a task asks of it.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the run that is in the folder, if any.")] = False,
    as_json: Json = False,
) -> None:
    """Make an agent better by direct random search. Ctrl-C keeps everything, --resume continues."""
    from drs_core.run_settings import read_run_settings
    from drs_core.where import chosen_place

    given: dict[str, Any] = {
        "updates": updates,
        "budget": budget,
        "reset_seconds": reset_seconds,
        "stop_when_flat": stop_when_flat,
        "directions": directions,
        "objective": objective,
        "smoothness_weight": smoothness_weight,
        "alpha": alpha,
        "sigma": sigma,
        "last_layer": last_layer,
        "action_gains": action_gains,
        "top": top,
        "paired_spread": paired_spread,
        "back_off": back_off,
        "evaluate_every": evaluate_every,
        "evaluation_episodes": evaluation_episodes,
        "attempts": attempts,
        "action_change_max": action_change_max,
        "observations": str(observations) if observations else None,
        "seed": seed,
        "backend": backend,
    }
    make = chosen_place(rollouts, ray, workers)
    settings = read_run_settings(params, {name: value for name, value in given.items() if value is not None})
    if stop_after is not None and stop_after < 1:
        raise UsageError(f"--stop-after is {stop_after}; allowed are 1 and more.")
    with _printer(as_json) as out, terminated_like_interrupted():
        _tune(agent, settings, output, stop_after, make, resume, out)


def _tune(
    name: str,
    settings: RunSettings,
    output: Path,
    stop_after: int | None,
    make_rollouts: MakeRollouts,
    resume: bool,
    out: Printer,
) -> None:
    from dataclasses import replace

    from drs_core.accelerator import choose
    from drs_core.importing import resolve
    from drs_core.recording.observed import of_recording
    from drs_core.reporting.closing import look_at
    from drs_core.reporting.progress import TuningProgress
    from drs_core.run_folder import RunFolder
    from drs_core.tuning import Tuning

    start = resolve(name)
    config, sentence = settings.planned(start.environment)
    config = replace(config, backend=choose(config.backend, start))
    last = min(stop_after or config.search.updates, config.search.updates)
    console = _messages()
    if sentence:
        console.print(sentence, highlight=False)
    # the simulators first: where they cannot be made, no run folder is begun
    with closing(make_rollouts(start, config.backend)) as rollouts:
        observe = partial(of_recording, Path(settings.observations), start) if settings.observations else None
        tuning = Tuning(start, name, config, output, resume, observe, settings.stop_when_flat, console.out)
        try:
            with TuningProgress(console, last) as progress:
                tuning.run(rollouts, progress, stop_after)
        except KeyboardInterrupt:
            console.print(
                f"Stopped after {tuning.done} updates, all kept in {output}; the same command with --resume goes on."
            )
            raise
    run = RunFolder(output)
    flat = tuning.flat.sentence() if tuning.flat else None
    result = {"output": str(output), "agent": str(run.agent), "updates_done": tuning.done, "flat": flat}
    weight = tuning.objective.smoothness_weight
    out.show(
        result | {"environment": start.environment, "updates": config.search.updates, "smoothness_weight": weight},
        *([f"Smoothness weight: {weight:.4g}"] if weight is not None else []),
        *([f"{flat} The best agent is {run.best}; --resume without the option goes on."] if flat else []),
        f"{tuning.done} of {config.search.updates} updates done: {run.agent}. {look_at(name, run)}",
    )


@app.command()
def agents(as_json: Json = False) -> None:
    """List the shipped agents."""
    from drs_core.agent import load
    from drs_core.agents import shipped
    from drs_core.reporting.tables import agent_line

    found = {name: load(path) for name, path in shipped().items()}
    rows = [
        {"name": name, "environment": agent.environment, "parameters": len(agent.theta), "source": dict(agent.source)}
        for name, agent in found.items()
    ]
    with _printer(as_json) as out:
        out.show(
            {"agents": rows},
            *(agent_line(row) for row in rows),
        )


@app.command()
def graph(
    params: Annotated[Path, typer.Argument(metavar="PARAMS", help="Parameter file of all nodes (see params/).")],
    simulators: Annotated[int, typer.Option(help="Simulator nodes.")] = 2,
    tune: Annotated[bool, typer.Option("--tune", help="Tune at once, and end all nodes when that is done.")] = False,
    output: Annotated[Path | None, typer.Option(parser=folder_named, metavar="PATH", help="Run folder.")] = None,
) -> None:
    """Start the ROS 2 graph without ros2 launch. Simulators, tuner and policy node; Ctrl-C ends them all."""
    from drs_core.graph import GraphConfig, run_graph

    status = run_graph(GraphConfig(params, simulators, tune, output))
    if status:
        raise typer.Exit(status)


app.command()(bench)
app.command()(record)
app.command()(replay)
app.command()(report)
app.command()(reproduce)
app.command()(train)


def main() -> NoReturn:
    """Run the command line: exit status 0, 2 for wrong use, 1 for failure, 130 when interrupted."""
    prepare_streams()
    try:
        app()
    except DrsError as error:
        fail(str(error), error.exit_status)
    except KeyboardInterrupt:
        sys.exit(130)
    except ModuleNotFoundError as error:
        fail(f"This needs {error.name}; {install('sim,report,train')}.", 1)
    except OSError as error:
        fail(f"{error.filename or 'Output'}: {error.strerror or error}.", 1)
    sys.exit(0)


if __name__ == "__main__":
    main()
