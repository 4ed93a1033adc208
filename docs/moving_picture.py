"""Makes the moving picture of the README: two robots are pushed, and their circuits answer.

`python docs/moving_picture.py [FILE]` writes it; docs/generate.py does so, too. It needs the extra `video`.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from circuitkit import simulate
from circuitkit.base.files import replacing
from circuitkit.simulation.film import FRAME_SIZE, FRAMES_PER_S, Reel

if TYPE_CHECKING:
    from PIL import Image

PICTURE = Path(__file__).parent / "img" / "moving.webp"
SHOWN = (("nao_push", 5.0), ("quadruped_trots", 4.4))  # scenario, and where the picture begins, [s]
DURATION_S = 4.4
EVERY = 2  # of the film's frames
SCALE = 0.65
GAP = 6  # between the robots, [pixels]
QUALITY = 58


def frames() -> Iterator[Image.Image]:
    """The frames: the robots side by side, in real time."""
    from PIL import Image

    with contextlib.ExitStack() as stack:
        reels = [stack.enter_context(contextlib.closing(Reel(simulate(name)))) for name, _ in SHOWN]
        width, height = FRAME_SIZE
        for number in range(0, round(DURATION_S * FRAMES_PER_S), EVERY):
            sheet = Image.new("RGB", (len(reels) * (width + GAP) - GAP, height), "white")
            for column, (reel, (_, begin_s)) in enumerate(zip(reels, SHOWN, strict=True)):
                sheet.paste(reel.frame(round(begin_s * FRAMES_PER_S) + number), (column * (width + GAP), 0))
            yield sheet.resize((round(sheet.width * SCALE), round(sheet.height * SCALE)), Image.Resampling.LANCZOS)


def write_moving_picture(path: Path = PICTURE) -> None:
    """Write the picture as a WebP that plays for ever."""
    first, *rest = frames()
    with replacing(path) as part:
        first.save(
            part, format="WEBP", save_all=True, append_images=rest, duration=1000 * EVERY // FRAMES_PER_S, loop=0,
            quality=QUALITY, method=6,
        )  # fmt: skip


if __name__ == "__main__":
    write_moving_picture(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
