"""The only place that turns messages into the library's values and back.

Large fields go through `array.array` and `numpy.frombuffer`: a list of a million numbers takes 100
times as long to assign.
"""

from __future__ import annotations

import array
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from drs_interfaces.msg import Action, Candidate, EpisodeResult, Observation
from drs_interfaces.srv import Evaluate, RunEpisodes
from numpy.typing import NDArray
from std_msgs.msg import Header

from drs_core.environments import Spaces, Step
from drs_core.episode import DIMENSION, MOTION, TRAJECTORY, Episode, unfinished
from drs_core.errors import UsageError, presentable
from drs_core.evaluation import Evaluation
from drs_core.measures.mesh_dimension import MeshDimension
from drs_core.measures.smoothness import TipMotion
from drs_core.policy import MAX_PARAMETERS
from drs_core.rollouts import Task
from drs_core.scope import Scope
from drs_core.search import MAX_DIRECTIONS, MAX_UPDATES, Perturbation

Float32 = NDArray[np.float32]

MEASURES = (DIMENSION, MOTION, TRAJECTORY)
MAX_CANDIDATES = 4096
MAX_OBSERVATION = 65_536
MAX_WHY = 200
NOT_HELD_S = -1.0
"""As wall_s of RunEpisodes says that nothing was run: another agent, backend or theta is in force."""
MAX_VALUE = 1e50
"""Of a return or an action change that is believed: the weight of `smooth` is at most 1e100, and squares are summed."""
MAX_DIMENSION = 1e6
"""Of a mesh dimension that is believed; half the features of any observation are less."""
_MOTION = (
    "tip_speed_mean",
    "tip_jerk_mean_square",
    "tip_position_std",
    "velocity_sign_flips",
    "log_dimensionless_jerk",
)
_MOTION_FIELDS = ("speed_mean", "jerk_mean_square", "position_std", "velocity_sign_flips", "log_dimensionless_jerk")


def floats(values: NDArray[np.floating]) -> array.array[float]:
    """An array of float32 or float64 as the field type of float32[] or float64[]."""
    contiguous = np.ascontiguousarray(values)
    return array.array("f" if contiguous.dtype == np.float32 else "d", contiguous.tobytes())


def theta_from(field: Any) -> Float32:
    """A float32[] field -> (d,) float32.

    Raises:
        UsageError: it is longer than any policy, or not finite.
    """
    if len(field) > MAX_PARAMETERS:
        raise UsageError(f"theta has {len(field)} numbers; allowed are at most {MAX_PARAMETERS}.")
    theta = np.frombuffer(field, dtype=np.float32).copy() if len(field) else np.empty(0, np.float32)
    wrong = int((~np.isfinite(theta)).sum())
    if wrong:
        raise UsageError(f"{wrong} of theta's {len(theta)} numbers are not finite; send finite ones.")
    return theta


def seed_from(field: int) -> int:
    """A uint64 field as an episode seed.

    Raises:
        UsageError: it is larger than environments take.
    """
    if field >= 2**63:
        raise UsageError(f"seed is {field}; allowed are 0 to 2^63 - 1.")
    return int(field)


def candidate_to_msg(task: Task) -> Candidate:
    """A task as a candidate; what to measure travels apart."""
    message = Candidate(episode_seed=task.seed)
    p = task.perturbation
    if p is not None:
        message.run_seed, message.update, message.direction = p.run_seed, p.update, p.direction
        message.sign, message.sigma = p.sign, p.sigma
        message.start, message.gains = p.scope.start, p.scope.gains
    return message


def task_from_msg(message: Candidate, measures: frozenset[str], parameters: int) -> Task:
    """A candidate for a policy of `parameters` parameters as a task.

    Raises:
        UsageError: a field is out of range.
    """
    if message.sign == 0:
        return Task(seed_from(message.episode_seed), measures)
    if message.sign not in (-1, 1):
        raise UsageError(f"A candidate's sign is {message.sign}; allowed are -1, 0 and 1.")
    if not (math.isfinite(message.sigma) and 0.0 <= message.sigma <= 1e3):
        raise UsageError(f"A candidate's sigma is {message.sigma}; allowed are finite numbers from 0 to 1000.")
    if message.update >= MAX_UPDATES or message.direction >= MAX_DIRECTIONS:
        raise UsageError(
            f"A candidate's update {message.update} or direction {message.direction} is out of range: "
            f"below {MAX_UPDATES} and {MAX_DIRECTIONS}."
        )
    if message.start >= parameters:
        raise UsageError(f"A candidate's start is {message.start}, but the policy has {parameters} parameters.")
    length = parameters - message.start
    if message.gains and (length < 2 * message.gains or length % message.gains):
        raise UsageError(f"A candidate has {message.gains} gains, which no last layer of {length} parameters has.")
    perturbation = Perturbation(
        int(message.run_seed), int(message.update), int(message.direction), int(message.sign), message.sigma,
        Scope(int(message.start), int(message.gains)),
    )  # fmt: skip
    return Task(seed_from(message.episode_seed), measures, perturbation)


def tasks_from_msg(candidates: Sequence[Candidate], measures: Sequence[str], parameters: int) -> list[Task]:
    """A batch of candidates as tasks.

    Raises:
        UsageError: there are none or too many, or a field is out of range or unknown.
    """
    if not 1 <= len(candidates) <= MAX_CANDIDATES:
        raise UsageError(f"There are {len(candidates)} candidates; allowed are 1 to {MAX_CANDIDATES}.")
    wanted = frozenset(measures)
    if not wanted <= set(MEASURES):
        raise UsageError(f"The measure {sorted(wanted - set(MEASURES))[0]!r} is unknown; known: {', '.join(MEASURES)}.")
    return [task_from_msg(candidate, wanted, parameters) for candidate in candidates]


def success_to_msg(success: bool | None) -> int:
    """One of the constants SUCCESS_*."""
    return Observation.SUCCESS_UNDEFINED if success is None else int(success)


def episode_to_msg(episode: Episode) -> EpisodeResult:
    """An episode as a message."""
    if not episode.finished:
        return EpisodeResult(seed=episode.seed, unfinished=True, why=episode.why)
    message = EpisodeResult(
        seed=episode.seed,
        return_sum=episode.return_,
        length=episode.length,
        terminated=episode.terminated,
        failed=episode.failed,
        success=success_to_msg(episode.success),
        action_change=episode.action_change,
    )
    if episode.dimension is not None:
        message.has_dimension, message.dimension_limit = True, episode.dimension.limit
        message.dimension_lower, message.dimension_upper = episode.dimension.lower, episode.dimension.upper
    if episode.motion is not None:
        message.has_motion = True
        for name, attribute in zip(_MOTION, _MOTION_FIELDS):
            setattr(message, name, getattr(episode.motion, attribute))
    if episode.tip_position is not None and episode.tip_velocity is not None:
        message.tip_position, message.tip_velocity = floats(episode.tip_position), floats(episode.tip_velocity)
    return message


def episode_from_msg(message: EpisodeResult) -> Episode:
    """A message as an episode.

    Raises:
        UsageError: positions and velocities of the tip are not as many rows of three.
    """
    if message.unfinished:
        return unfinished(int(message.seed), " ".join(presentable(message.why, MAX_WHY).split()))
    motion, path = None, {}
    if message.has_motion:
        motion = TipMotion(*(getattr(message, name) for name in _MOTION))
    if len(message.tip_position) != len(message.tip_velocity) or len(message.tip_position) % 3:
        raise UsageError(
            f"An episode has {len(message.tip_position)} numbers of tip positions and {len(message.tip_velocity)} "
            "of velocities; they must be as many, three a step."
        )
    if len(message.tip_position):
        path = {
            name: np.frombuffer(getattr(message, name), dtype=np.float32).reshape(-1, 3).copy()
            for name in ("tip_position", "tip_velocity")
        }
    dimension = None
    if message.has_dimension:
        dimension = MeshDimension(message.dimension_lower, message.dimension_upper, message.dimension_limit)
    return Episode(
        seed=int(message.seed),
        return_=message.return_sum,
        length=int(message.length),
        terminated=message.terminated,
        failed=message.failed,
        success=None if message.success < 0 else bool(message.success),
        action_change=message.action_change,
        dimension=dimension,
        motion=motion,
        **path,
    )


def answer_from_msg(message: EpisodeResult, measures: Sequence[str]) -> Episode:
    """A simulator's answer as an episode that a search can use.

    Raises:
        UsageError: it lacks the dimension that was asked for, or a number that decides cannot be.
    """
    episode = episode_from_msg(message)
    if not episode.finished:
        return episode
    for name, value in (("return", episode.return_), ("action change", episode.action_change)):
        _check(episode, name, value, -MAX_VALUE, MAX_VALUE)
    if DIMENSION in measures and episode.dimension is None:
        raise UsageError(f"The episode of seed {episode.seed} lacks the measure {DIMENSION}, which was asked for.")
    if episode.dimension is not None:
        _check(episode, "dimension limit", episode.dimension.limit, 0.5, MAX_DIMENSION)
        for name, value in (("lower", episode.dimension.lower), ("upper", episode.dimension.upper)):
            # not a number: it cannot be computed
            if not math.isnan(value):
                _check(episode, f"{name} dimension bound", value, -MAX_DIMENSION, MAX_DIMENSION)
    return episode


def _check(episode: Episode, name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise UsageError(
            f"The episode of seed {episode.seed} has the {name} {value}; allowed are numbers from {low:g} to {high:g}."
        )


def is_not_held(response: RunEpisodes.Response) -> bool:
    """Whether a simulator refused a request only because it was told something else meanwhile, or restarted."""
    return not response.success and response.wall_s < 0.0


def answers_from_msg(
    response: RunEpisodes.Response, request_id: int, seeds: Sequence[int], measures: Sequence[str]
) -> list[Episode]:
    """A simulator's answer to a request as episodes, one for each seed and in their order.

    Raises:
        UsageError: it answers another request or other episodes, or as `answer_from_msg` does.
    """
    found = [int(message.seed) for message in response.episodes]
    if response.request_id != request_id:
        raise UsageError(f"It answered to request {response.request_id} where {request_id} was asked.")
    if len(found) != len(seeds):
        raise UsageError(f"It answered with {len(found)} episodes where {len(seeds)} were asked.")
    wrong = [(got, asked) for got, asked in zip(found, seeds) if got != asked]
    if wrong:
        raise UsageError("It answered with the episode of seed {} where that of seed {} was asked.".format(*wrong[0]))
    return [answer_from_msg(message, measures) for message in response.episodes]


def observation_to_msg(environment_id: str, spaces: Spaces, step: Step, number: int, seed: int, count: int) -> Any:
    """What an environment shows after `count` steps of the episode of `seed`, as observation `number`."""
    observation = step.observation
    parts = [observation[key] if isinstance(observation, dict) else observation for key in spaces.parts]
    return Observation(
        number=number,
        episode_seed=seed,
        step=count,
        environment=environment_id,
        keys=list(spaces.parts),
        sizes=array.array("I", spaces.parts.values()),
        values=floats(np.concatenate(parts).astype(np.float64)),
        reward=step.reward,
        terminated=step.terminated,
        truncated=step.truncated,
        success=success_to_msg(step.success),
    )


def observation_from_msg(message: Observation) -> dict[str, NDArray[np.float64]]:
    """The parts of an observation by key, float64: wide enough for every environment's own precision.

    Raises:
        UsageError: sizes do not fit, or a number is not finite.
    """
    sizes = [int(size) for size in message.sizes]
    if len(sizes) != len(message.keys) or sum(sizes) != len(message.values) or sum(sizes) > MAX_OBSERVATION:
        raise UsageError(f"An observation has parts of sizes {sizes[:9]}, but {len(message.values)} values.")
    values = np.frombuffer(message.values, dtype=np.float64) if len(message.values) else np.empty(0)
    if not np.isfinite(values).all():
        raise UsageError("An observation has values that are not finite; it is not answered.")
    ends = np.cumsum(sizes)
    return {key: values[end - size : end] for key, size, end in zip(message.keys, sizes, ends)}


def action_to_msg(action: Float32, header: Header, number: int) -> Action:
    """The answer to the observation of this header and number."""
    return Action(header=header, observation=number, values=floats(action))


def action_from(field: Any, low: Float32, high: Float32) -> Float32:
    """A float32[] field as an action (n_actions,) float32 within its bounds.

    Raises:
        UsageError: it has another length, or is not finite.
    """
    if len(field) != len(low):
        raise UsageError(f"An action has {len(field)} values; the environment takes {len(low)}.")
    action = np.frombuffer(field, dtype=np.float32)
    # clipping would let a NaN through
    if not np.isfinite(action).all():
        raise UsageError("An action has values that are not finite; it is not used.")
    return np.clip(action, low, high)


def evaluation_to_msg(
    response: Evaluate.Response, summary: dict[str, Any], evaluation: Evaluation, message: str
) -> None:
    """Fill in the answer of /evaluate from an evaluation and its summary."""
    response.message, response.returns = message, floats(evaluation.returns)
    for name in (
        "agent", "environment", "episodes", "return_mean", "return_std", "length_mean", "failure_percent",
        "dimension_mean", "dimension_std", "dimension_lower_mean", "dimension_upper_mean",
    ):  # fmt: skip
        setattr(response, name, summary[name])
    response.unfinished = evaluation.unfinished
    response.return_ci_low, response.return_ci_high = summary["return_ci95"] or (math.nan, math.nan)
    response.failure_ci_low, response.failure_ci_high = summary["failure_ci95"]
    response.success_percent = math.nan if summary["success_percent"] is None else summary["success_percent"]
