"""Jobs, which are runs that are stepped together, and who does them.

They are done in this process, in processes of this machine, or by a Dask scheduler's workers. Each is an
`Executor` of `concurrent.futures`; anybody's own may take its place, in a `Workers`.
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from circuitkit.base.errors import CircuitkitError, InputError, MissingDependencyError, listing
from circuitkit.simulation import Disturbance, RunSpec
from circuitkit.simulation.loop import run_and_watch
from circuitkit.simulation.measures import CLAMPED, RMS
from circuitkit.study.cases import Case, ChangedError, Outcome, plan_of
from circuitkit.study.identity import all_versions
from circuitkit.study.processes import Processes, this_process

_CONNECT_S = 10.0
_ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?([\w.-]+|\[[0-9A-Fa-f:.%]+\]):[0-9]{1,5}")
_MOST_WORKERS = 1024

T = TypeVar("T")


@dataclass(frozen=True)
class Job:
    """Runs of cases that share everything but what may differ in a batch.

    Attributes:
        case: One of the cases.
        specs: The runs.
    """

    case: Case
    specs: tuple[RunSpec, ...]


def this_worker() -> str:
    """The name of this process, and its address if it is a worker of Dask."""
    name = this_process()
    if "distributed" in sys.modules:
        with suppress(ValueError):  # it is none
            return f"{sys.modules['distributed'].get_worker().address}, {name}"
    return name


@dataclass(frozen=True)
class Done:
    """A job that is done.

    Attributes:
        outcomes: One for each run, or what keeps that run's case from being run.
        environment: With what it was done: versions, and the backends of circuits where they are known.
        worker: Who has done it.
        seconds: How long it took, [s].
    """

    outcomes: tuple[Outcome | CircuitkitError, ...]
    environment: Mapping[str, Mapping[str, str]]
    worker: str = field(default_factory=this_worker)
    seconds: float = 0.0


def run_job(job: Job) -> Done:
    """Do a job with one thread.

    A run gets the same outcome, to the last bit, whatever the other runs of its job are.

    Raises:
        ChangedError: Something that determines its runs has changed.
        KeyboardInterrupt: Ctrl-C came; nothing is kept.
    """
    began = time.perf_counter()
    case = job.case
    known = all_versions(case.scenario, None, case.reference, case.controller)
    environment: dict[str, dict[str, str]] = {"versions": known, "backend": {}}
    outcomes = _outcomes(case, job.specs, environment)
    return Done(outcomes, environment, seconds=time.perf_counter() - began)


def _outcomes(
    case: Case, specs: tuple[RunSpec, ...], environment: dict[str, dict[str, str]]
) -> tuple[Outcome | CircuitkitError, ...]:
    """The outcomes of runs; `environment` takes with what they were done."""
    try:
        plan = plan_of(case)
        controller = plan.controller(case.controller)
        environment["backend"] |= getattr(controller, "backends", {})
        robot = plan.robot.robot
        environment["versions"] |= all_versions(case.scenario, robot, case.reference, case.controller)
        tracker = run_and_watch(plan.setup(controller, specs), threads=1)
    except ChangedError:
        raise
    except CircuitkitError as error:
        kinds: list[tuple[Disturbance, ...]] = []
        for spec in specs:
            if spec.disturbances not in kinds:
                kinds.append(spec.disturbances)
        if len(kinds) == 1:
            return (error,) * len(specs)
        found: dict[int, Outcome | CircuitkitError] = {}  # whose fault is it?
        for disturbances in kinds:
            chosen = [i for i, spec in enumerate(specs) if spec.disturbances == disturbances]
            some = _outcomes(case, tuple(specs[i] for i in chosen), environment)
            found |= dict(zip(chosen, some, strict=True))
        return tuple(found[i] for i in range(len(specs)))
    each = zip(
        specs, tracker.measures(), tracker.effort(), tracker.clamped().tolist(), tracker.invalid, strict=True
    )
    return tuple(
        Outcome(spec.seed, {**measures, CLAMPED: clamped, **_named(effort)}, why)
        for spec, measures, effort, clamped, why in each
    )


def _named(effort: Mapping[str, float | None]) -> dict[str, float | None]:
    return {f"{RMS}{name}": value for name, value in effort.items()}


class WorkerError(CircuitkitError):
    """A worker has ended, cannot be reached, or is stuck."""


class LostJobError(WorkerError):
    """A worker has ended, and its job with it; another one may do that job."""


def _as_it_is(error: Exception) -> Exception:
    return error


@dataclass(frozen=True)
class Workers:
    """An executor for jobs; `open_workers` opens one for as long as a block lasts.

    Attributes:
        executor: Does the jobs.
        slots: How many jobs to hand in before waiting for one, as of now.
        explain: What the user is told when the executor itself fails.
        timeout_s: How long a job may take, [s]; if None, much longer than those before it.
        busy: Who does jobs, for messages.
        elsewhere: Whether the workers may be on other machines, where files may be others.
    """

    executor: Executor
    slots: Callable[[], int]
    explain: Callable[[Exception], Exception] = _as_it_is
    timeout_s: float | None = None
    busy: Callable[[], str] = lambda: "a worker"
    elsewhere: bool = False

    def submit(self, job: Job) -> Future[Done]:
        """Hand in a job.

        Raises:
            WorkerError: The executor takes no more.
        """
        try:
            return self.executor.submit(run_job, job)
        except BrokenExecutor as error:
            raise self.explain(error) from error

    def outcome(self, future: Future[Done], case: Case) -> Done:
        """What a job that is done has brought.

        Args:
            future: The job.
            case: One of its cases.

        Raises:
            LostJobError: Its worker has ended.
            WorkerError: The executor has failed, or the worker has other versions of what the bits depend on.
            ChangedError: Something that determines the runs has changed since they were asked for.
        """
        try:
            done = future.result()
        except CircuitkitError:
            raise
        except BrokenExecutor as error:
            if not isinstance(self.executor, Processes):
                raise self.explain(error) from error
            how, by_signal = self.executor.how_it_ended(future)
            hint = (
                "the machine may be out of memory: take fewer --workers"
                if by_signal
                else 'a script that starts workers needs `if __name__ == "__main__":` around its main part'
            )
            message = f"{self.executor.name(future)} {how}; {hint}"
            raise LostJobError(message) from error
        except Exception as error:
            raise self.explain(error) from error
        require_same_environment(done, case)
        if self.elsewhere:
            told = tuple(_told_by(done.worker, each) for each in done.outcomes)
            return replace(done, outcomes=told)
        return done

    def stop(self, future: Future[Done], seconds: float) -> None:
        """End a job that takes longer than it should; it is lost then.

        Raises:
            WorkerError: Workers of this kind cannot be ended from here.
        """
        if isinstance(self.executor, Processes):
            self.executor.kill(future)
            return
        future.cancel()
        message = (
            f"{self.busy()} has been at a batch for {seconds:.0f} s; see to it, or allow more by "
            "--timeout (timeout_s), and go on by --resume"
        )
        raise WorkerError(message)


def _told_by(worker: str, outcome: Outcome | CircuitkitError) -> Outcome | CircuitkitError:
    """What a worker elsewhere complains of, with its name: files that it needs may be missing there."""
    if not isinstance(outcome, InputError):
        return outcome
    told = f"so says the worker {worker}, which needs the same files at the same paths"
    return InputError(*(replace(p, hint=f"{p.hint}; {told}" if p.hint else told) for p in outcome.problems))


class ThisProcess(Executor):
    """Does a job when it is handed in."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:  # noqa: ANN401 - any
        """Do the job."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # who asks for the result gets it
            future.set_exception(error)
        return future


@contextmanager
def _dask(address: str) -> Iterator[Workers]:
    """Workers of a Dask scheduler; a worker that is lost has its jobs done by another one.

    Raises:
        MissingDependencyError: distributed is not installed.
        WorkerError: There is no scheduler at this address, or it has no workers.
    """
    client = _client(address)

    def slots() -> int:
        """One job under way and one waiting for each thread that there is now, so that none waits for us."""
        return max(2 * int(sum(client.nthreads().values())), 1)

    def busy() -> str:
        """The addresses of the workers that do something."""
        names = listing(name for name, jobs in client.processing().items() if jobs)
        return f"one of the Dask workers at {names}"

    def explain(error: Exception) -> Exception:
        return WorkerError(
            f"the Dask workers of '{address}' cannot do a job: {type(error).__name__}: {error}"
        )

    try:
        if not client.nthreads():
            message = f"the Dask scheduler at '{address}' has no workers; start some: dask worker {address}"
            raise WorkerError(message)
        yield Workers(client.get_executor(pure=False), slots, explain, busy=busy, elsewhere=True)
    finally:
        client.close()  # takes back what is under way, and leaves the scheduler and its workers as they are


def _client(address: str) -> Any:  # noqa: ANN401 - distributed is not typed
    try:
        from distributed import Client  # an extra
    except ImportError as error:
        package, extra = "distributed", "cluster"
        raise MissingDependencyError(package, extra, "a sweep on a Dask scheduler") from error
    if not _ADDRESS.fullmatch(address):  # or distributed leaves a client behind that never closes
        allowed = "the address of a Dask scheduler, such as tcp://192.168.0.7:8786"
        message = f"found '{address}'; allowed: {allowed}"
        raise WorkerError(message)
    try:
        client: Any = Client
        return client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        message = (
            f"cannot reach a Dask scheduler at '{address}': {error}; "
            "start one with `dask scheduler`, and workers with `dask worker tcp://HOST:8786 --nthreads 1`"
        )
        raise WorkerError(message) from error


def require_same_environment(done: Done, case: Case) -> None:
    """Refuse outcomes that other versions, or another backend, may have made otherwise.

    Raises:
        WorkerError: They are not those with which the case was made.
    """
    for kind, words in (("versions", ""), ("backend", "run the circuit by the backend ")):
        ours, found = case.parts[kind].data, done.environment[kind]
        other = [name for name in {**ours, **found} if name in found and ours.get(name) != found[name]]
        if other:
            shown = listing(f"{name} {found[name]}" for name in other)
            allowed = listing(f"{name} {ours.get(name)}" for name in other)
            message = f"the worker {done.worker} has {words}{shown}; allowed: as this process, {allowed}"
            raise WorkerError(message)


@contextmanager
def _processes(count: int) -> Iterator[Workers]:
    executor = Processes(count)
    try:
        yield Workers(executor, lambda: count)
    finally:
        executor.shutdown()


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def open_workers(
    count: int | None = None, scheduler: str | None = None, timeout_s: float | None = None
) -> Iterator[Workers]:
    """Workers for as long as the block lasts.

    Args:
        count: Processes of this machine; by default one for each processor. One is this process itself.
        scheduler: Address of a Dask scheduler, such as `tcp://192.168.0.7:8786`, to use its workers instead.
        timeout_s: How long a job may take until its worker counts as stuck, [s]; by default much longer than
            the jobs before it. What this process does itself has no limit.

    Raises:
        CircuitkitError: `count` is less than 1, or given together with `scheduler`.
        MissingDependencyError: `scheduler` needs distributed, which is not installed.
        WorkerError: The scheduler cannot be reached.
    """
    if scheduler is not None and count is not None:
        message = "the workers of a scheduler are its own; give workers or scheduler, not both"
        raise CircuitkitError(message)
    if count is not None and not 1 <= count <= _MOST_WORKERS:
        message = f"found {count} workers; allowed: 1 to {_MOST_WORKERS}"
        raise CircuitkitError(message)
    number = count or processors()
    if scheduler is not None:
        with _dask(scheduler) as workers:
            yield replace(workers, timeout_s=timeout_s)
    elif number == 1:
        yield Workers(ThisProcess(), lambda: 1)
    else:
        with _processes(number) as workers:
            yield replace(workers, timeout_s=timeout_s)
