"""Makes the paper's figures, and what it left open, with a report that sets its claims beside ours.

`figure` finds the figures, each a class in a module of this package, and has what a figure gets (`Job`);
`finding` is what it returns. `run` makes them one after the other, and `report` writes them down.
"""

from circuitkit.paper.reproduce.figure import FIGURES, Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import Claim, Finding, Picture, Table, Verdict
from circuitkit.paper.reproduce.run import reproduce

__all__ = [
    "FIGURES",
    "Claim",
    "Effort",
    "Finding",
    "Job",
    "Picture",
    "ReportFigure",
    "Table",
    "Verdict",
    "reproduce",
]
