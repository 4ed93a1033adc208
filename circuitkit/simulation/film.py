"""Films of recordings: the robot, pushes as arrows, the circuit with its active neurons, and channels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from circuitkit.base.errors import MissingDependencyError
from circuitkit.base.files import replacing
from circuitkit.base.progress import progress_bar
from circuitkit.draw.style import GREY, INK, PAPER
from circuitkit.simulation.panel import PANEL_HEIGHT, PANEL_WIDTH, ChartRow, Panel, chart_of, font
from circuitkit.simulation.result import PushSpan, Result, summarise
from circuitkit.simulation.scene import CameraScene

if TYPE_CHECKING:
    from PIL import Image, ImageDraw

FRAMES_PER_S = 25
SCENE_HEIGHT = 440
FRAME_SIZE = (PANEL_WIDTH, SCENE_HEIGHT + PANEL_HEIGHT)

_LONGEST_S = 30.0  # of a film
_VERDICT_S = 1.5  # for so long at the end the film says how it ended
_RED = "#c8201a"
_GAP = 4  # between films side by side, [pixels]
_FADED = 0.45  # how much of a film that is over is white
_QUALITY = ("-preset", "veryfast", "-crf", "21")


def film(results: Sequence[Result], path: Path, *, progress: bool = False) -> Path:
    """Write runs next to each other as one MP4; one that is over early fades and waits.

    The film runs in real time, or where that would be longer than half a minute, so many times as fast that
    it is not.

    Args:
        results: At least one run, the one on the left first.
        path: The file, .mp4.
        progress: Show a bar on a terminal.

    Raises:
        MissingDependencyError: imageio-ffmpeg is not installed.
        RendererError: There is no off-screen renderer.
        OutputError: The file cannot be written.
    """
    encode = _encoder()
    longest_s = max(result.recording.ticks * result.recording.step_s for result in results)
    pace = max(math.ceil(longest_s / _LONGEST_S), 1)
    length = max(frame_count(result, pace) for result in results)
    width = len(results) * FRAME_SIZE[0] + (len(results) - 1) * _GAP
    with ExitStack() as stack:
        show = stack.enter_context(progress_bar("film", length, shown=progress))
        chart = chart_of(results)
        reels = [stack.enter_context(closing(Reel(result, pace, chart))) for result in results]
        part = stack.enter_context(replacing(path))
        write = stack.enter_context(encode(part, (width, FRAME_SIZE[1])))
        for number, frame in enumerate(_joined(reels, length, width)):
            write(frame)
            if show is not None:
                show(number + 1)
    return path


def frame_count(result: Result, pace: int = 1) -> int:
    """How many frames a run has that is shown so many times as fast as it was."""
    duration_s = result.recording.ticks * result.recording.step_s
    return max(round(duration_s * FRAMES_PER_S / pace), 1)


class Reel:
    """The frames of one run."""

    def __init__(self, result: Result, pace: int = 1, chart: Sequence[ChartRow] | None = None) -> None:
        """Set everything up for `frame`.

        Args:
            result: The run.
            pace: How many times as fast it is shown.
            chart: The channels below the robot; by default those of this run alone.

        Raises:
            RendererError: There is no off-screen renderer.
        """
        recording = result.recording
        self.length, self._pace = frame_count(result, pace), pace
        self._summary = summarise(result)
        self._panel = Panel(result, self._summary, chart=chart)
        self._scene = CameraScene(recording, PANEL_WIDTH, SCENE_HEIGHT)
        self._last = recording.ticks - 1
        if self._summary.ended_s is not None:
            self._last = self._scene.replay.last_above_ground(int(recording.end_tick[0]))

    def frame(self, number: int) -> Image.Image:
        """A frame by its number; after the last one, the last one, faded."""
        from PIL import Image  # an extra

        time_s = min(number, self.length - 1) * self._pace / FRAMES_PER_S
        row = max(round(time_s / self._summary.step_s) - 1, 0)
        row = min(row, len(self._summary.time_s) - 1)
        push = self.push_at(time_s)
        image = Image.new("RGB", FRAME_SIZE, PAPER)
        scene = self._scene.picture(min(row, self._last), push)
        self._write_on(scene, row, push)
        image.paste(scene, (0, 0))
        image.paste(self._panel.picture(row), (0, SCENE_HEIGHT))
        return image if number < self.length else _faded(image)

    def push_at(self, time_s: float) -> PushSpan | None:
        """The push whose arrow is shown at a time."""
        return next((push for push in self._summary.pushes if push.shown_at(time_s)), None)

    def _write_on(self, scene: Image.Image, row: int, push: PushSpan | None) -> None:
        from PIL import ImageDraw  # an extra

        pen = ImageDraw.Draw(scene)
        summary = self._summary
        time = float(summary.time_s[row])
        _write(pen, (14, 12), summary.controller, 24, "la", bold=True)
        _write(pen, (scene.width - 14, 14), f"{time:.2f} s", 20, "ra")
        good = summary.good
        if time >= (summary.time_s[-1] - _VERDICT_S if summary.ended_s is None else summary.ended_s):
            _write(pen, (14, 44), summary.outcome, 17, "la", bold=True, fill=INK if good else _RED)
        if self._pace > 1:
            _write(pen, (scene.width - 14, 40), f"{self._pace} times as fast", 14, "ra")
        if push is not None:
            x, y = self._scene.beside_arrow(push)
            at = (min(max(x, 40), scene.width - 40), y - 12)
            _write(pen, at, f"{push.size_n:.3g} N", 18, "ms", bold=True, fill=_RED)

    def close(self) -> None:
        """Give the renderer back."""
        self._scene.close()


def _joined(reels: Sequence[Reel], length: int, width: int) -> Iterator[Image.Image]:
    """Frames of all reels next to each other; the frame of a reel that is over is made once."""
    from PIL import Image  # an extra

    over: dict[int, Image.Image] = {}
    for number in range(length):
        whole = Image.new("RGB", (width, FRAME_SIZE[1]), GREY)
        for column, reel in enumerate(reels):
            if number >= reel.length and column not in over:
                over[column] = reel.frame(number)
            frame = over.get(column) or reel.frame(number)
            whole.paste(frame, (column * (FRAME_SIZE[0] + _GAP), 0))
        yield whole


def _faded(image: Image.Image) -> Image.Image:
    from PIL import Image  # an extra

    grey = image.convert("L").convert("RGB")
    return Image.blend(grey, Image.new("RGB", image.size, PAPER), _FADED)


def _write(
    pen: ImageDraw.ImageDraw, at: tuple[float, float], text: str, size: float, anchor: str,
    *, bold: bool = False, fill: str = INK,
) -> None:  # fmt: skip
    """Text with a white rim, readable on anything."""
    rim: dict[str, Any] = {"stroke_width": 2, "stroke_fill": PAPER}
    pen.text(at, text, fill=fill, font=font(size, bold=bold), anchor=anchor, **rim)


def _encoder() -> Any:  # noqa: ANN401 - a context manager that gives a function
    """What writes an MP4; found before anything is drawn.

    Raises:
        MissingDependencyError: imageio-ffmpeg is not installed.
    """
    try:
        import imageio_ffmpeg  # an extra

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        package, extra, purpose = "imageio-ffmpeg", "video", "writing a video"
        raise MissingDependencyError(package, extra, purpose) from error

    @contextmanager
    def encode(path: Path, size: tuple[int, int]) -> Iterator[Callable[[Image.Image], None]]:
        writer = imageio_ffmpeg.write_frames(
            str(path), size, fps=FRAMES_PER_S, codec="libx264", quality=None, macro_block_size=2,
            output_params=list(_QUALITY), ffmpeg_log_level="error",
        )  # fmt: skip
        writer.send(None)
        try:
            yield lambda image: writer.send(np.asarray(image))
        finally:
            writer.close()

    return encode
