"""Studies: many runs to one answer, on one machine or on many.

Every name below is imported when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from circuitkit.study.case_builder import CaseBuilder
    from circuitkit.study.cases import Case
    from circuitkit.study.driver import load_study, run_cases, run_studies, sweep
    from circuitkit.study.jobs import Outcome
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

_MODULES = {
    "case_builder": "CaseBuilder",
    "cases": "Case",
    "jobs": "Outcome",
    "results": "Limit Results Share wilson_interval",
    "spec": "Cell Study make_study read_study",
    "store": "read_results",
    "workers": "Workers open_workers",
    "driver": "load_study run_cases run_studies sweep",
}
_MODULE_OF_NAME = {name: module for module, names in _MODULES.items() for name in names.split()}


def __getattr__(name: str) -> object:
    if name not in _MODULE_OF_NAME:
        message = f"module 'circuitkit.study' has no attribute '{name}'"
        raise AttributeError(message)
    return getattr(importlib.import_module(f"circuitkit.study.{_MODULE_OF_NAME[name]}"), name)
