"""Findings and figures that nothing was run for."""

from __future__ import annotations

import base64
from typing import ClassVar

from circuitkit.paper.reproduce.figure import Effort, ReportFigure
from circuitkit.paper.reproduce.finding import Claim, Finding, Picture, Table, Verdict

# The smallest PNG there is: one pixel.
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNk+A8AAQUBAScY42YAAAAASUVORK5CYII="
)


def a_claim(verdict=Verdict.HOLDS, **changes):
    return Claim(
        **{
            "claim": "It stands",
            "paper": "22 N",
            "ours": "20 N",
            "how": "seeds 0 | 1",
            "verdict": verdict,
            "source": "section 5",
            **changes,
        }
    )


def a_finding(figure="fig9", **changes):
    return Finding(
        **{
            "figure": figure,
            "title": f"Title of {figure}",
            "claims": (a_claim(),),
            "pictures": (Picture(f"{figure}.png", "Caption.", "What it shows."),),
            "tables": (Table("Numbers", ("who", ">force [N]"), (("open loop", "4"), ("BiNN", "20"))),),
            "text": f"Text of {figure}.",
            "seeds": "seeds 0 to 19",
            "studies": (figure,),
            "data": {"force_n": [4.0, 20.0]},
            **changes,
        }
    )


def drawn(folder, figure="fig9"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{figure}.png").write_bytes(PIXEL)


def made_up_figure(number=0):
    """A figure that keeps the jobs for which it is made, and raises its `error` if it has one."""

    class MadeUp(ReportFigure):
        kind = "made_up"
        order = number
        title = "Made up"
        effort = Effort(full_s=100.0, quick_s=10.0)
        jobs: ClassVar[list] = []
        error = None

        def run(self, job):
            self.jobs.append(job)
            if self.error is not None:
                raise self.error
            drawn(job.folder, job.figure)
            return a_finding(job.figure)

    MadeUp.jobs = []
    return MadeUp
