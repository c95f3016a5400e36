"""``drs train``: its options, and what it prints."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from drs_core.errors import UsageError
from drs_core.files import check_output
from drs_core.options import Json, folder_named


def train(
    algorithm: Annotated[str, typer.Argument(metavar="ALGO", help="a2c, ppo, ddpg, td3, sac or tqc.")],
    environment: Annotated[str, typer.Argument(metavar="ENV", help="gymnasium id.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Agent file for the best agent, *.safetensors.")],
    run: Annotated[
        Path | None,
        typer.Option(
            parser=folder_named, metavar="PATH", help="Training folder. [default: beside the output, *.training]"
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the training in the folder, if any.")] = False,
    checkpoint_minutes: Annotated[float, typer.Option(help="Minutes between two states on disk.")] = 3.0,
    steps: Annotated[int | None, typer.Option(help="Environment steps, at most. [default: by environment]")] = None,
    seed: Annotated[int, typer.Option(help="Seed of everything.")] = 0,
    hidden: Annotated[str | None, typer.Option(help="Units of the hidden layers, such as 64,64.")] = None,
    time_feature: Annotated[bool | None, typer.Option(help="Observe the remaining time.")] = None,
    teacher: Annotated[
        bool | None, typer.Option(help="A scripted controller acts in the warm-up. [default: by environment]")
    ] = None,
    evaluate_every: Annotated[
        int | None, typer.Option(help="Steps between evaluations. [default: by environment]")
    ] = None,
    evaluation_episodes: Annotated[
        int | None, typer.Option(help="Episodes that decide which is the best. [Panda: 100, others: 20]")
    ] = None,
    stop_at_success: Annotated[float | None, typer.Option(help="Stop at this success in percent.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", help="A setting of the algorithm, such as gradient_steps=2.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the output file if it exists.")] = False,
    as_json: Json = False,
) -> None:
    """Train a baseline with Stable-Baselines3 or sb3-contrib. With hindsight experience replay (HER) for Panda."""
    from drs_core.reporting.console import messages, printer
    from drs_core.training.config import TrainConfig
    from drs_core.training.train import train as run_training

    # an interrupted training has left the best of its first part there
    check_output(output, force or resume)
    try:
        layers = tuple(int(units) for units in hidden.split(",")) if hidden is not None else None
    except ValueError as error:
        raise UsageError(f"--hidden is {hidden!r}; write whole numbers such as 64,64.") from error
    config = TrainConfig(
        algorithm=algorithm.lower(),
        environment=environment,
        steps=steps,
        seed=seed,
        hidden=layers,
        time_feature=time_feature,
        teacher=teacher,
        evaluate_every=evaluate_every,
        episodes=evaluation_episodes,
        stop_at_success=stop_at_success,
        settings=_settings(set_ or []),
    )
    folder = run if run is not None else output.with_name(f"{output.stem}.training")
    with printer(as_json) as out:
        trained = run_training(config, folder, messages().print, resume=resume, checkpoint_minutes=checkpoint_minutes)
        agent = trained.agent
        if agent is not None:
            agent.save(output)
        if agent is None or not trained.finished:
            raise KeyboardInterrupt
        result = {"output": str(output), "environment": agent.environment, "steps": agent.source["steps"]}
        out.show(
            result | {"run": str(folder), "wall_s": agent.source["wall_s"], "evaluation": agent.source["evaluation"]},
            f"{output}: the best {algorithm} agent for {agent.environment}, of step {agent.source['steps']}. "
            f"Look at it with: drs evaluate {output}",
        )


def _settings(given: list[str]) -> dict[str, Any]:
    from drs_core.files import parse_json

    settings = {}
    for text in given:
        name, sign, value = text.partition("=")
        if not (name.isidentifier() and sign and value):
            raise UsageError(f"--set is {text!r}; write NAME=VALUE, such as gradient_steps=2.")
        try:
            settings[name] = parse_json(value, text)
        except UsageError:
            settings[name] = value  # a word, such as auto
    return settings
