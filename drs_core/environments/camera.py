"""A camera for any environment, without a display; looking changes nothing of the episode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drs_core.environments.catalogue import entry
from drs_core.environments.environment import Environment
from drs_core.environments.quiet import quiet
from drs_core.errors import DrsError

Image = NDArray[np.uint8]

SKY = (226, 231, 237)
_FLOOR, _TABLE, _GOAL = (0.86, 0.88, 0.90, 1.0), (0.97, 0.96, 0.94, 1.0), (0.0, 0.62, 0.45, 1.0)
_ABOVE_TABLE_M = np.array([0.04, 0.0, 0.2])
"""Where panda-gym's tip begins."""
_NEAR_M, _FAR_M = 0.05, 50.0


class View(NamedTuple):
    """Where a camera of PyBullet stands: distance [m], angles and field of view [degrees]."""

    distance_m: float
    yaw: float
    pitch: float
    field_of_view: float


_ARM = View(0.45, 40.0, -18.0, 40.0)
_WALKER = View(3.2, 0.0, -12.0, 45.0)
_WALKER_HEIGHT_M = 0.8


class Frame(NamedTuple):
    """One picture, (height, width, 3) uint8, and where in it the tip is, (x, y) in pixels (Panda)."""

    image: Image
    tip: tuple[float, float] | None


Camera = Callable[[], Frame]


def camera(environment: Environment, width: int, height: int) -> Camera:
    """A function that takes a picture of an environment made with `visible`, after its reset.

    Raises:
        DrsError: the environment cannot draw itself.
    """
    env, family = environment.unwrapped, entry(environment.id).family
    if family.startswith("panda"):
        return _panda(env, width, height)
    if family == "locomotion":
        return _walker(env, width, height)
    return _drawn(environment, width, height)


def _panda(env: Any, width: int, height: int) -> Camera:
    client, bodies = env.sim.physics_client, env.sim._bodies_idx
    for body, colour in (("plane", _FLOOR), ("table", _TABLE), ("target", _GOAL)):
        if body in bodies:
            client.changeVisualShape(bodies[body], -1, rgbaColor=colour)
    goal = np.asarray(env.task.get_goal(), dtype=np.float64)[:3]
    # close to the goal, where an arm shakes; the hand is in the picture from the beginning
    centre = 0.75 * goal + 0.25 * _ABOVE_TABLE_M + [0.0, 0.0, 0.01]

    def take() -> Frame:
        image, matrix = _picture(client, centre, _ARM, width, height)
        x, y, _, w = matrix @ np.append(env.robot.get_ee_position(), 1.0)
        return Frame(image, ((1.0 + x / w) * width / 2.0, (1.0 - y / w) * height / 2.0))

    return take


def _walker(env: Any, width: int, height: int) -> Camera:
    def take() -> Frame:
        x, y, _ = env.robot.robot_body.current_position()
        return Frame(_picture(env._p, np.array([x, y, _WALKER_HEIGHT_M]), _WALKER, width, height)[0], None)

    return take


def _picture(
    client: Any, centre: NDArray[np.float64], view: View, width: int, height: int
) -> tuple[Image, NDArray[np.float64]]:
    """A picture by PyBullet's renderer in software, and the matrix from world to picture."""
    import pybullet

    look = client.computeViewMatrixFromYawPitchRoll(list(centre), view.distance_m, view.yaw, view.pitch, 0.0, 2)
    lens = client.computeProjectionMatrixFOV(view.field_of_view, width / height, _NEAR_M, _FAR_M)
    _, _, pixels, _, bodies = client.getCameraImage(
        width, height, look, lens, shadow=0, renderer=pybullet.ER_TINY_RENDERER
    )
    image = np.asarray(pixels, dtype=np.uint8).reshape(height, width, 4)[..., :3].copy()
    image[np.asarray(bodies).reshape(height, width) == -1] = SKY
    # PyBullet's matrices are columns first
    return image, np.reshape(lens, (4, 4)).T @ np.reshape(look, (4, 4)).T


def _drawn(environment: Environment, width: int, height: int) -> Camera:
    from PIL import Image as Picture

    def take() -> Frame:
        try:
            with quiet():
                drawn = environment.unwrapped.render()
        except Exception as error:  # an environment's renderer may fail in any way
            raise DrsError(f"{environment.id} gives no picture of itself: {str(error)[:200]}") from error
        if not isinstance(drawn, np.ndarray) or drawn.ndim != 3 or drawn.shape[2] != 3:
            raise DrsError(f"{environment.id} gives no picture of itself.")
        # whole, on a ground of its own corner's colour
        scale = min(width / drawn.shape[1], height / drawn.shape[0])
        size = (max(1, round(drawn.shape[1] * scale)), max(1, round(drawn.shape[0] * scale)))
        frame = np.full((height, width, 3), drawn[0, 0], dtype=np.uint8)
        top, left = (height - size[1]) // 2, (width - size[0]) // 2
        picture = Picture.fromarray(drawn.astype(np.uint8)).resize(size, Picture.Resampling.LANCZOS)
        frame[top : top + size[1], left : left + size[0]] = np.asarray(picture)
        return Frame(frame, None)

    return take
