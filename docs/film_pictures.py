"""Makes the pictures of the README and the pages that are frames of films; it needs the extra `video`.

`python docs/film_pictures.py` writes them: two robots that are pushed, moving; a still of each robot that
ships; and the pushed NAO under two controllers. docs/generate.py calls `write_film_pictures`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from circuitkit import compare, simulate
from circuitkit.base.files import replacing
from circuitkit.simulation.film import FRAME_SIZE, FRAMES_PER_S, SCENE_HEIGHT, Reel

if TYPE_CHECKING:
    from PIL import Image

IMAGES = Path(__file__).parent / "img"
PUSHED = (("nao_push", 5.0), ("quadruped_trots", 4.4))  # scenario, and where the moving picture begins, [s]
STILLS = {  # scenario and time of the still of a robot, [s]
    "arm": ("arm_reflex", 1.4),
    "cartpole": ("cartpole_balances", 10.4),
    "hexapod": ("hexapod_walks", 3.0),
    "lamprey": ("lamprey_swims", 8.0),
    "nao": ("nao_push", 5.7),
    "quadruped": ("quadruped_trots", 5.2),
    "vehicle": ("vehicle_avoids", 12.0),
}
DURATION_S = 4.2
EVERY = 2  # of the film's frames
SCALE = 0.65
GAP = 6  # between the robots, [pixels]
QUALITY = 58
STILL_SIZE = (320, 220)
PUSH_STILLS_S = (5.68, 6.6, 7.2)  # during the push, and after it until one of them falls
PUSH_SCALE = 2 / 3


def frames() -> Iterator[Image.Image]:
    """The frames of the moving picture: the robots side by side, in real time."""
    from PIL import Image

    with contextlib.ExitStack() as stack:
        reels = [stack.enter_context(contextlib.closing(Reel(simulate(name)))) for name, _ in PUSHED]
        width, height = FRAME_SIZE
        for number in range(0, round(DURATION_S * FRAMES_PER_S), EVERY):
            sheet = Image.new("RGB", (len(reels) * (width + GAP) - GAP, height), "white")
            for column, (reel, (_, begin_s)) in enumerate(zip(reels, PUSHED, strict=True)):
                sheet.paste(reel.frame(round(begin_s * FRAMES_PER_S) + number), (column * (width + GAP), 0))
            size = round(sheet.width * SCALE), round(sheet.height * SCALE)
            yield sheet.resize(size, Image.Resampling.LANCZOS)


def write_moving_picture() -> None:
    """Write the moving picture, a WebP that plays for ever."""
    first, *rest = frames()
    with replacing(IMAGES / "moving.webp") as part:
        lasts_ms = 1000 * EVERY // FRAMES_PER_S
        first.save(
            part, format="WEBP", save_all=True, append_images=rest, duration=lasts_ms, loop=0,
            quality=QUALITY, method=6,
        )  # fmt: skip


def scene(reel: Reel, time_s: float) -> Image.Image:
    """A frame without the panels below it, whose text is too small for a still."""
    return reel.frame(round(time_s * FRAMES_PER_S)).crop((0, 0, FRAME_SIZE[0], SCENE_HEIGHT))


def write_stills() -> None:
    """Write a still of each robot."""
    from PIL import Image

    for robot, (scenario, time_s) in STILLS.items():
        with contextlib.closing(Reel(simulate(scenario))) as reel:
            still = scene(reel, time_s)
        with replacing(IMAGES / f"robot_{robot}.webp") as part:
            still.resize(STILL_SIZE, Image.Resampling.LANCZOS).save(part, format="WEBP", quality=85, method=6)


def write_push_stills() -> None:
    """Write the pushed NAO: a row for each controller, a column for each moment."""
    from PIL import Image

    width, height = (round(length * PUSH_SCALE) for length in (FRAME_SIZE[0], SCENE_HEIGHT))
    results = compare("nao_push", ["open_loop", "circuit"])
    sheet = Image.new("RGB", (width * len(PUSH_STILLS_S), height * len(results)))
    for row, result in enumerate(results):
        with contextlib.closing(Reel(result)) as reel:
            for column, time_s in enumerate(PUSH_STILLS_S):
                still = scene(reel, time_s).resize((width, height), Image.Resampling.LANCZOS)
                sheet.paste(still, (column * width, row * height))
    with replacing(IMAGES / "nao_push.png") as part:
        sheet.save(part, format="PNG", optimize=True)


def write_film_pictures() -> None:
    """Write all of them."""
    write_moving_picture()
    write_stills()
    write_push_stills()


if __name__ == "__main__":
    write_film_pictures()
