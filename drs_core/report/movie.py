"""The film: before and after side by side, labelled, in real time, as H.264 that every browser plays."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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
_GAP, _HOLD_S, _TRAIL_S = 8, 0.6, 1.0
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
    duration_s: float


def make_movie(scenes: Sequence[Scene], labels: Sequence[str], frame_s: float, step_s: float) -> Movie:
    """Lay out and encode; pictures are `frame_s` apart, steps `step_s`.

    Raises:
        DrsError: the encoder failed.
    """
    frames = [frame for scene in scenes for frame in _scene(scene, labels, frame_s, step_s)]
    width, height = frames[0].size
    # towards the end of the first episode: there the goal is reached, or missed
    still = frames[int(0.85 * max(len(clip.frames) for clip in scenes[0].clips))]
    buffer = io.BytesIO()
    still.save(buffer, "JPEG", quality=82, optimize=True)
    for quality in _QUALITIES:
        mp4 = _encode(frames, 1.0 / frame_s, quality)
        if len(mp4) <= MAX_BYTES:
            return Movie(mp4, buffer.getvalue(), width, height, len(frames) * frame_s)
    raise DrsError(f"The film has {len(mp4)} bytes, more than {MAX_BYTES}; make the report with --no-video.")


def _scene(scene: Scene, labels: Sequence[str], frame_s: float, step_s: float) -> Iterator[Image]:
    count = max(len(clip.frames) for clip in scene.clips)
    for index in range(count + round(_HOLD_S / frame_s)):
        sides = [
            _side(clip, episode, label, index, frame_s, step_s)
            for clip, episode, label in zip(scene.clips, scene.episodes, labels, strict=True)
        ]
        yield _beside(sides, f"{min(index, count - 1) * frame_s:4.1f} s    {scene.title}")


def _side(clip: Clip, episode: Episode, label: str, index: int, frame_s: float, step_s: float) -> Image:
    from PIL import Image, ImageDraw

    at = min(index, len(clip.frames) - 1)
    image = Image.open(io.BytesIO(clip.frames[at])).convert("RGB")
    draw, colour = ImageDraw.Draw(image), LIGHT.side(label)
    trail = [tip for tip in clip.tips[max(0, at - round(_TRAIL_S / frame_s)) : at + 1] if tip is not None]
    if len(trail) > 1:
        draw.line(trail, fill=_PLATE, width=5, joint="curve")
        draw.line(trail, fill=colour, width=3, joint="curve")
    draw.rounded_rectangle((14, 14, 24 + _text_width(label, 26) + 12, 54), 8, fill=colour)
    draw.text((25, 33), label, fill=_PLATE, font=_font(26), anchor="lm")
    if index >= len(clip.frames) and len(clip.frames) > 0 and (episode.failed or episode.success):
        how = "failed" if episode.failed else "done"
        text = f"{how} after {episode.length * step_s:.1f} s"
        draw.rounded_rectangle((14, 64, 24 + _text_width(text, 22) + 12, 98), 8, fill=_PLATE)
        draw.text((25, 80), text, fill=_INK, font=_font(22), anchor="lm")
    return image


def _beside(sides: list[Image], footer: str) -> Image:
    from PIL import Image, ImageDraw

    width = len(sides) * WIDTH + (len(sides) - 1) * _GAP
    frame = Image.new("RGB", (width, HEIGHT + 40), _PLATE)
    for place, side in enumerate(sides):
        frame.paste(side, (place * (WIDTH + _GAP), 0))
    ImageDraw.Draw(frame).text((12, HEIGHT + 20), footer, fill=_INK, font=_font(22), anchor="lm")
    return frame


def _font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)


def _text_width(text: str, size: int) -> int:
    return int(_font(size).getlength(text))


def _encode(frames: Sequence[Image], fps: float, quality: str) -> bytes:
    import imageio_ffmpeg

    options = ["-crf", quality, "-preset", "medium", "-movflags", "+faststart", "-map_metadata", "-1"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        writer = imageio_ffmpeg.write_frames(
            str(path),
            frames[0].size,
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
