"""What each family of environments needs so that an episode depends on its seed alone.

Each cure takes the unwrapped environment and returns a function to call before every reset.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_FAR_ABOVE_M = 3.0


def _nothing() -> None:
    return None


def locomotion(env: Any) -> Callable[[], None]:
    """PyBullet locomotion: the first reset still lacks the floor in ``robot.parts``; throw one away."""
    env.reset(seed=0)
    return _nothing


def bipedal(env: Any) -> Callable[[], None]:
    """BipedalWalker: Box2D's world keeps an order of contacts from earlier episodes; make a new one."""
    from Box2D import b2World

    def before_reset() -> None:
        env._destroy()
        env.world = b2World()

    return before_reset


def panda(env: Any) -> Callable[[], None]:
    """Panda with an object: contact caches survive a restored state unless nothing touches.

    With the arm in its neutral pose and the object high above, one step empties the caches; then
    the state of creation is restored. Without an object there is another memory: the order in which
    Bullet found the pairs of bodies that may touch, which is that of their contacts where several
    parts of the arm press on the table. No state holds it, so Bullet is told to sort them.
    """
    sim = env.sim
    if "object" not in sim._bodies_idx:
        sim.physics_client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        return _nothing
    state = sim.save_state()

    def before_reset() -> None:
        env.robot.set_joint_neutral()
        sim.set_base_pose("object", [0.0, 0.0, _FAR_ABOVE_M], [0.0, 0.0, 0.0, 1.0])
        sim.physics_client.stepSimulation()
        sim.restore_state(state)

    return before_reset


CURES: dict[str, Callable[[Any], Callable[[], None]]] = {
    "bipedal": bipedal,
    "classic": lambda env: _nothing,
    "locomotion": locomotion,
    "panda": panda,
    "panda-other": lambda env: _nothing,
}
