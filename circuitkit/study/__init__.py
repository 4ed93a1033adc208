"""Studies: many runs to one answer, on one machine or on many.

Benchmarks (`study.bench`) and tunings (`study.tuning`) are imported by themselves; the latter need an extra.
"""

from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import Case, Outcome
from circuitkit.study.driver import load_study, run_cases, run_studies, sweep
from circuitkit.study.results import Limit, Results, Share, wilson_interval
from circuitkit.study.spec import Cell, Study, make_study, read_study
from circuitkit.study.store import read_results
from circuitkit.study.workers import Workers, open_workers

__all__ = [
    "Case",
    "CaseBuilder",
    "Cell",
    "Limit",
    "Outcome",
    "Results",
    "Share",
    "Study",
    "Workers",
    "load_study",
    "make_study",
    "open_workers",
    "read_results",
    "read_study",
    "run_cases",
    "run_studies",
    "sweep",
    "wilson_interval",
]
