"""The film: before and after side by side, labelled, in real time, as H.264 that every browser plays."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drs_core.episode import Episode
from drs_core.errors import DrsError
from drs_core.report.film import HEIGHT, WIDTH, Clip
from drs_core.reporting.colours import LIGHT

if TYPE_CHECKING:
    from PIL.Image import Image

MAX_BYTES = 3_000_000
_QUALITIES = ("23", "28", "34")
"""x264's constant rate factors, tried until the film is small enough."""
_GAP, _BAND, _FONT_PX = 8, 48, 28
_HOLD_S, _TRAIL_S = 0.6, 1.0
_PLATE, _INK = (255, 255, 255), (28, 33, 38)


@dataclass(frozen=True)
class Scene:
    """One seed: what it is called, and a clip and its episode for each side."""

    title: str
    clips: list[Clip]
    episodes: list[Episode]


@dataclass(frozen=True)
class Movie:
    """The film as MP4, and one still of it as JPEG."""

    mp4: bytes
    still: bytes
    width: int
    height: int


def make_movie(scenes: Sequence[Scene], labels: Sequence[str], frame_s: float, step_s: float) -> Movie:
    """Lay out and encode; pictures are `frame_s` apart, steps `step_s`.

    Raises:
        DrsError: the encoder failed.
    """

    def frames() -> Iterator[Image]:
        # one at a time: a minute of them would fill the memory of a small machine
        for scene in scenes:
            yield from _scene(scene, labels, frame_s, step_s)

    # towards the end of the first episode: there the goal is reached, or missed
    still = next(islice(frames(), int(0.85 * max(len(clip.frames) for clip in scenes[0].clips)), None))
    buffer = io.BytesIO()
    still.save(buffer, "JPEG", quality=82, optimize=True)
    for quality in _QUALITIES:
        mp4 = _encode(frames(), still.size, 1.0 / frame_s, quality)
        if len(mp4) <= MAX_BYTES:
            return Movie(mp4, buffer.getvalue(), *still.size)
    raise DrsError(f"The film has {len(mp4)} bytes, more than {MAX_BYTES}; make the report with --no-video.")


def _scene(scene: Scene, labels: Sequence[str], frame_s: float, step_s: float) -> Iterator[Image]:
    count = max(len(clip.frames) for clip in scene.clips)
    for index in range(count + round(_HOLD_S / frame_s)):
        sides = [
            _side(clip, episode, label, index, frame_s, step_s)
            for clip, episode, label in zip(scene.clips, scene.episodes, labels, strict=True)
        ]
        yield _beside(sides, labels, [f"{min(index, count - 1) * frame_s:.1f} s", scene.title])


def _side(clip: Clip, episode: Episode, label: str, index: int, frame_s: float, step_s: float) -> Image:
    from PIL import Image, ImageDraw

    at = min(index, len(clip.frames) - 1)
    image = Image.open(io.BytesIO(clip.frames[at])).convert("RGB")
    draw, colour = ImageDraw.Draw(image), LIGHT.side(label)
    trail = [tip for tip in clip.tips[max(0, at - round(_TRAIL_S / frame_s)) : at + 1] if tip is not None]
    if len(trail) > 1:
        draw.line(trail, fill=_PLATE, width=5, joint="curve")
        draw.line(trail, fill=colour, width=3, joint="curve")
    if index >= len(clip.frames) and (episode.failed or episode.success):
        text = f"{'failed' if episode.failed else 'done'} after {episode.length * step_s:.1f} s"
        draw.rounded_rectangle((14, 14, 38 + _font().getlength(text), 52), 8, fill=_PLATE)
        draw.text((26, 33), text, fill=_INK, font=_font(), anchor="lm")
    return image


def _beside(sides: list[Image], labels: Sequence[str], facts: Sequence[str]) -> Image:
    """Labels and facts stand above the pictures, where a player's controls hide nothing."""
    from PIL import Image, ImageDraw

    width = len(sides) * WIDTH + (len(sides) - 1) * _GAP
    frame = Image.new("RGB", (width, HEIGHT + _BAND), _PLATE)
    draw = ImageDraw.Draw(frame)
    for place, (side, label) in enumerate(zip(sides, labels, strict=True)):
        left = place * (WIDTH + _GAP)
        frame.paste(side, (left, _BAND))
        draw.rounded_rectangle((left, 0, left + WIDTH - 1, _BAND - 1), 0, fill=LIGHT.side(label))
        draw.text((left + 14, _BAND // 2), label, fill=_PLATE, font=_font(), anchor="lm")
        draw.text((left + WIDTH - 14, _BAND // 2), facts[place], fill=_PLATE, font=_font(), anchor="rm")
    return frame


def _font() -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(_FONT_PX)


def _encode(frames: Iterable[Image], size: tuple[int, int], fps: float, quality: str) -> bytes:
    import imageio_ffmpeg

    options = ["-crf", quality, "-preset", "medium", "-movflags", "+faststart", "-map_metadata", "-1"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        writer = imageio_ffmpeg.write_frames(
            str(path),
            size,
            fps=fps,
            codec="libx264",
            pix_fmt_out="yuv420p",
            macro_block_size=2,
            quality=None,
            ffmpeg_log_level="error",
            output_params=[*options, "-fflags", "+bitexact", "-threads", "2"],
        )
        try:
            writer.send(None)
            for frame in frames:
                writer.send(np.asarray(frame))
            writer.close()
            return path.read_bytes()
        except (OSError, RuntimeError) as error:
            raise DrsError(f"The film could not be encoded: {str(error)[-200:]}. --no-video does without.") from error
