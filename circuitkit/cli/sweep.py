"""`circuitkit sweep`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from circuitkit.base.units import format_quantity
from circuitkit.cli.options import Timeout
from circuitkit.cli.printing import counted, examples, note, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.study import Results, Share, Study
    from circuitkit.study.driver import Estimate

_MINUTE_S, _HOUR_S = 60.0, 3600.0

PLACE = 40


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit sweep push_limits -o out/push_limits",
            "circuitkit sweep push_limits --dry-run",
            "circuitkit sweep push_limits --seeds 2 -o out/quick --workers 1",
            "circuitkit sweep my_study.yaml -o out/mine --resume",
            "circuitkit sweep my_study.yaml -o out/mine --scheduler tcp://192.168.0.7:8786",
        )
    )(sweep)


def sweep(
    study: Annotated[
        str, typer.Argument(metavar="STUDY", help="A study file, or the name of a shipped one.")
    ],
    *,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", min=1, help="Processes; by default one for each processor."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the results that DIR has, and do not run them again.")
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="tcp://HOST:PORT", help="Use the workers of this Dask scheduler instead."
        ),
    ] = None,
    batch: Annotated[
        int | None,
        typer.Option("--batch", metavar="N", min=1, help="Runs that a worker steps together, at most."),
    ] = None,
    timeout: Timeout = None,
    seeds: Annotated[
        int | None,
        typer.Option("--seeds", metavar="N", min=1, help="Only the first N seeds, for a quick look."),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option(
            "--by",
            metavar="AXIS,AXIS...",
            help="Print shares of survived runs by these axes only, over all values of the others.",
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say how many runs there would be and how long they take.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the limits or shares as JSON.")] = False,
) -> None:
    """Run a study: many simulations to one table.

    Prints the largest value that each cell of the study survives, or the share of the runs that it survives
    where nothing is searched, with a 95 % interval. Writes DIR/results.parquet, one row a run. The rows are
    the same whatever --workers, --batch and --scheduler are.

    Ctrl-C keeps what is done. Missing folders of DIR are made.
    """
    if output is None and not dry_run:
        message = "name a folder for the results: -o DIR"
        raise typer.BadParameter(message, param_hint="--output")
    from circuitkit.study import load_study  # late: see cli/__init__.py
    from circuitkit.study import sweep as run_sweep  # the same
    from circuitkit.study.driver import estimate  # the same
    from circuitkit.study.workers import processors  # the same

    loaded = load_study(study)
    if seeds is not None:
        loaded = loaded.with_({"seeds": {"count": min(seeds, len(loaded.seeds))}})
    if dry_run:
        _print_estimate(loaded, estimate(loaded), workers or processors(), as_json=as_json)
        return
    axes = None if by is None else [name.strip() for name in by.split(",") if name.strip()]
    loaded.require_axes(axes or ())
    results = run_sweep(
        loaded,
        output or Path(),
        workers=workers,
        resume=resume,
        scheduler=scheduler,
        batch=batch,
        timeout_s=timeout,
    )
    if as_json:
        print_json(_as_data(results, output, axes))
        return
    _print_found(results, axes)
    for remark in results.remarks():
        note(remark)
    note(f"wrote {(output or Path()) / 'results.parquet'}: {counted(len(results.rows), 'run')}")


def _as_data(results: Results, folder: Path | None = None, by: Sequence[str] | None = None) -> dict[str, Any]:
    """What was found, for JSON: limits in SI units, or shares."""
    search = results.study.search
    data: dict[str, Any] = {
        "study": results.study.name,
        "runs": len(results.rows),
        "results": None if folder is None else str(folder / "results.parquet"),
        "remarks": list(results.remarks()),
    }
    if search is None or by is not None:
        data["shares"] = [_of_share(share) for share in results.shares(by)]
        return data
    data["searched"] = search.field
    data["unit"] = search.unit.dimension.si_symbol
    data["limits"] = [
        {
            "labels": dict(limit.labels),
            "largest": limit.largest,
            "survived": limit.survived,
            "runs": limit.runs,
            "interval": list(limit.interval),
            "fails_at": limit.fails_at,
            "unknown_at": limit.unknown_at,
            "holds_again": [asdict(each) for each in limit.holds_again],
            "hole": [asdict(each) for each in limit.hole],
            "tried": [asdict(each) for each in limit.tried],
        }
        for limit in results.limits()
    ]
    return data


def _of_share(share: Share) -> dict[str, Any]:
    return {
        "labels": dict(share.labels),
        "share": share.share,
        "survived": share.survived,
        "runs": share.runs,
        "invalid": share.invalid,
        "unknown": share.unknown,
        "interval": list(share.interval),
        "means": dict(share.means),
    }


def _print_found(results: Results, by: Sequence[str] | None = None) -> None:
    """Print limits, or shares."""
    study, search = results.study, results.study.search
    if search is None or by is not None:
        shares = results.shares(by)
        apart = {
            name: each
            for name, each in {
                ">invalid": [share.invalid for share in shares],
                ">unknown": [share.unknown for share in shares],
            }.items()
            if any(each)
        }
        rows = (
            (
                *share.texts.values(),
                f"{share.survived} of {share.runs}",
                _percents(share.interval),
                *(str(each[number]) for each in apart.values()),
                *("-" if math.isnan(mean) else f"{mean:.4g}" for mean in share.means.values()),
            )
            for number, share in enumerate(shares)
        )
        means = [f">{name}" for name in shares[0].means]
        title = f"{study.name}{', means of the other measures in SI units' if means else ''}"
        print_table(title, (*shares[0].texts, ">survived", "95 % interval", *apart, *means), rows)
        return
    unit, limits = search.unit, results.limits()
    unknown = any(limit.unknown_at is not None for limit in limits)
    holes = any(limit.holds_again for limit in limits)

    def written(value: float | None) -> str:
        return "-" if value is None else format_quantity(value, unit)

    found = (
        (
            *limit.texts.values(),
            written(limit.largest),
            f"{limit.survived} of {limit.runs}",
            _percents(limit.interval),
            written(limit.fails_at),
            *((written(limit.unknown_at),) if unknown else ()),
            *((", ".join(written(each.value) for each in limit.holds_again) or "-",) if holes else ()),
        )
        for limit in limits
    )
    headings = (
        *study.axes,
        f">largest {_last(search.field)}",
        f">{search.condition}",
        "95 % interval",
        ">fails at",
        *((">unknown at",) if unknown else ()),
        *((">holds again at",) if holes else ()),
    )
    print_table(f"{study.name}: {search.field}", headings, found)


def _last(path: str) -> str:
    return path.rpartition(".")[2]


def _percents(interval: tuple[float, float]) -> str:
    return f"{interval[0] * 100:.0f} to {interval[1] * 100:.0f} %"


def _print_estimate(study: Study, found: Estimate, count: int, *, as_json: bool) -> None:
    """What a study will take with so many workers."""
    seconds = found.takes_s(count)
    if as_json:
        print_json(_estimate_data(study, found, count, seconds))
        return
    axes: Iterable[Sequence[str]] = (
        (name, ", ".join(value.text for value in values)) for name, values in study.axes.items()
    )
    print_table(study.name, ("axis", "values"), axes)
    about = "" if study.search is None else f"about {found.runs}, at most {found.most}, "
    total = f"{found.runs} " if study.search is None else ""
    span = f"{found.shortest_s:g} s"
    if not math.isclose(found.shortest_s, found.longest_s):
        span = f"{found.shortest_s:g} to {found.longest_s:g} s"
    cells, each = counted(found.cells, "cell"), counted(len(study.seeds), "seed")
    print(f"{cells}, {each}: {about}{total}runs of {span} each")
    print(
        f"about {_duration(seconds)} with {counted(count, 'worker')} here, by the time that a few robots took"
    )


def _estimate_data(study: Study, found: Estimate, workers: int, seconds: float) -> Mapping[str, Any]:
    return {
        "study": study.name,
        "cells": found.cells,
        "seeds": len(study.seeds),
        "runs": found.runs,
        "most_runs": found.most,
        "workers": workers,
        "seconds": seconds,
    }


def _duration(seconds: float) -> str:
    """A time as a person says it."""
    scales: tuple[tuple[float, float, str], ...] = (
        (2 * _MINUTE_S, 1.0, "s"),
        (2 * _HOUR_S, _MINUTE_S, "min"),
        (math.inf, _HOUR_S, "h"),
    )
    shown: Callable[[float], str] = "{:.3g}".format
    return next(f"{shown(seconds / unit)} {name}" for most, unit, name in scales if seconds < most)
