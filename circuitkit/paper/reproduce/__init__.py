"""The paper, figure by figure, and what it left open, with a report that sets its claims beside ours.

`registry` lists the figures, each a module with `run(job) -> Finding`; `job` is what it gets, `finding` what
it gives; `run` makes them one after the other and `report` writes them down.
"""

from circuitkit.paper.reproduce.finding import Claim, Finding, Picture, Table, Verdict
from circuitkit.paper.reproduce.job import Effort, Job
from circuitkit.paper.reproduce.registry import FIGURES
from circuitkit.paper.reproduce.run import reproduce

__all__ = ["FIGURES", "Claim", "Effort", "Finding", "Job", "Picture", "Table", "Verdict", "reproduce"]
