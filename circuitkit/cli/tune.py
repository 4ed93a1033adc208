"""`circuitkit tune`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from circuitkit.base.progress import progress_bar
from circuitkit.cli.options import Timeout
from circuitkit.cli.printing import examples, note, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.study.tuning.measure import Progress
    from circuitkit.study.tuning.run import Tuned
    from circuitkit.study.tuning.spec import Tuning

PLACE = 41


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit tune tune_lateral -o out/lateral",
            "circuitkit tune tune_lateral -o out/lateral --trials 400 --resume",
            "circuitkit tune my_study.yaml -o out/mine --storage postgresql://user@host/tuning",
            "circuitkit tune my_study.yaml -o out/mine --result circuits/mine.yaml --json",
        )
    )(tune)


def tune(
    study: Annotated[
        str,
        typer.Argument(metavar="STUDY", help="A study with a section tune, or the name of a shipped one."),
    ],
    *,
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder for the result, the history and the trials."
        ),
    ],
    trials: Annotated[
        int | None,
        typer.Option(
            "--trials", metavar="N", min=1, help="How many candidates, instead of the file's number."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", min=1, help="How many processes; all processors by default."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="URL", help="Run on the workers of this Dask scheduler instead."),
    ] = None,
    storage: Annotated[
        str | None,
        typer.Option(
            "--storage", metavar="URL", help="Keep the trials in this database, not in DIR/trials.db."
        ),
    ] = None,
    timeout: Timeout = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the trials that are there, as if never stopped.")
    ] = False,
    result: Annotated[
        Path | None,
        typer.Option("--result", metavar="FILE", help="Write the tuned file there, not into DIR."),
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Also say what each generation brought, and let Optuna log.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Search for the values with which a circuit does best.

    Candidates are compared by training runs; the best one is then measured once, by test runs on other seeds.
    Ctrl-C keeps what is known and writes the best so far.
    """
    from circuitkit.study.tuning.run import tune as run_tuning  # late: see cli/__init__.py
    from circuitkit.study.tuning.spec import load_tuning  # the same

    tuning = load_tuning(study)
    with _progress(verbose=verbose) as progress:
        tuned = run_tuning(
            tuning,
            output,
            trials=trials,
            workers=workers,
            scheduler=scheduler,
            storage=storage,
            resume=resume,
            result=result,
            verbose=verbose,
            progress=progress,
            timeout_s=timeout,
        )
    if as_json:
        print_json(tuned.row())
    else:
        _print(tuning, tuned)
        note(f"wrote {tuned.path}")
    if tuned.history.interrupted:
        raise KeyboardInterrupt(tuned.kept)


def _print(tuning: Tuning, tuned: Tuned) -> None:
    """The figures of the start and of the best candidate, and its values."""
    spec, best = tuning.spec, tuned.best
    columns = [
        (f"start (number {tuned.start.number})", tuned.start.value, tuned.start.figures)
        if tuned.start
        else None,
        (f"best (number {best.number})", best.value, best.figures),
        ("best, confirmed", tuned.confirmed.value, tuned.confirmed.figures) if tuned.confirmed else None,
        ("best, test", tuned.test.value, tuned.test.figures) if tuned.test else None,
    ]
    shown = [column for column in columns if column is not None]
    names = [f"{term.name}{f' [{term.unit}]' if term.unit else ''}" for term in spec.terms]
    rows = [("objective", *(f"{value or 0.0:.4g}" for _, value, _ in shown))]
    rows += [
        (name, *(f"{figures[number]:.4g}" for _, _, figures in shown)) for number, name in enumerate(names)
    ]
    headings = ("", *(f">{heading}" for heading, _, _ in shown))
    print_table(f"{tuning.file.study}: {len(tuned.history.trials)} candidates", headings, rows)
    moved = [
        (name, tuned.start.settings.get(name, "") if tuned.start else "", text)
        for name, text in best.settings.items()
    ]
    print_table("", ("value", ">start", ">best"), moved)


@contextmanager
def _progress(*, verbose: bool) -> Iterator[Callable[[Progress], None] | None]:
    """A bar on a terminal; with `verbose` a line for each generation."""
    with progress_bar("tuning") as advance:
        if advance is None and not verbose:
            yield None
            return
        known = -1

        def report(progress: Progress) -> None:
            nonlocal known
            words = _in_words(progress)
            if advance is not None:
                advance(progress.done, progress.trials, words)
            if verbose and progress.best is not None and progress.measured > known:
                known = progress.measured
                note(words)

        yield report


def _in_words(progress: Progress) -> str:
    """Such as `train: 48 of 200, best 0.731 (number 40), about 12 min left`."""
    words = [f"{progress.stage}: {progress.done:.0f} of {progress.trials}"]
    if progress.best is not None and progress.best.value is not None:
        words.append(f"best {progress.best.value:.4g} (number {progress.best.number})")
    if progress.remaining_s is not None:
        minutes, seconds = divmod(round(progress.remaining_s), 60)
        words.append(f"about {minutes} min left" if minutes else f"about {seconds} s left")
    return ", ".join(words)
