"""Recorded episodes played again before a camera: the same actions, so the same episode bit for bit."""

from __future__ import annotations

import io
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass

import numpy as np

from drs_core.environments.camera import Frame, camera
from drs_core.environments.environment import Environment
from drs_core.episode import Episode
from drs_core.errors import DrsError

WIDTH, HEIGHT = 480, 432
_FINER = 1.25
"""PyBullet's renderer has hard edges: a larger picture is taken, and made smaller."""
_MOST_FPS, _MOST_FRAMES = 30.0, 400
_JPEG_QUALITY = 95


@dataclass(frozen=True)
class Take:
    """One episode to film: where it happens, what was done, and every how many steps a picture is taken."""

    environment: str
    episode: Episode
    every: int


@dataclass(frozen=True)
class Clip:
    """Pictures of one episode from its reset on, as JPEG, and where the tip is in each (Panda)."""

    frames: list[bytes]
    tips: list[tuple[float, float] | None]


def every_steps(step_s: float, longest_steps: int) -> int:
    """Steps from picture to picture: at most 30 a second, and no more than a page can carry."""
    return max(1, int(np.ceil(1.0 / (_MOST_FPS * step_s) - 1e-9)), int(np.ceil(longest_steps / _MOST_FRAMES)))


def film(take: Take) -> Clip:
    """Play one episode and take pictures.

    Raises:
        DrsError: the environment gives no pictures, or with a camera another episode.
    """
    episode = take.episode
    if episode.actions is None:
        raise ValueError("the episode was run without recording its actions")
    clip, total, last = Clip([], []), 0.0, len(episode.actions)
    with closing(Environment(take.environment, visible=True)) as environment:
        environment.reset(episode.seed)
        look = camera(environment, round(WIDTH * _FINER), round(HEIGHT * _FINER))
        _keep(clip, look())
        for count, action in enumerate(episode.actions, start=1):
            total += environment.step(action).reward
            if count % take.every == 0 or count == last:
                _keep(clip, look())
    if total != episode.return_:
        raise DrsError(
            f"{take.environment} gave another episode before the camera (seed {episode.seed}, "
            f"return {total:g}, not {episode.return_:g})."
        )
    return clip


def _keep(clip: Clip, frame: Frame) -> None:
    from PIL import Image

    buffer = io.BytesIO()
    picture = Image.fromarray(frame.image).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    picture.save(buffer, "JPEG", quality=_JPEG_QUALITY)
    clip.frames.append(buffer.getvalue())
    clip.tips.append(None if frame.tip is None else (frame.tip[0] / _FINER, frame.tip[1] / _FINER))


def film_all(takes: list[Take], workers: int, progress: Callable[[int], None]) -> list[Clip]:
    """Film all, in processes of their own or with workers = 0 in this one.

    Raises:
        DrsError: as `film`; or a process died.
    """
    clips = []
    with _mapper(min(workers, len(takes))) as mapped:
        for clip in mapped(takes):
            clips.append(clip)
            progress(len(clips))
    return clips


@contextmanager
def _mapper(workers: int) -> Iterator[Callable[[list[Take]], Iterator[Clip]]]:
    if not workers:
        yield lambda takes: map(film, takes)
        return
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_begin_worker) as pool:
        try:
            yield lambda takes: pool.map(film, takes)
        except BrokenProcessPool as error:
            raise DrsError("A process that films ended; is there enough memory? --no-video does without.") from error
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _begin_worker() -> None:
    # Ctrl-C reaches the whole process group; the parent decides what it means
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
