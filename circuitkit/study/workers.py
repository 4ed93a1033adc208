"""Jobs, which are runs that are stepped together, and who does them.

They are done in this process, in processes of this machine, or by a Dask scheduler's workers. Each is an
`Executor` of `concurrent.futures`; anybody's own may take its place, in a `Workers`.
"""

from __future__ import annotations

import os
import re
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, TypeVar

from circuitkit.base.errors import CircuitkitError, MissingDependencyError, listing
from circuitkit.simulation import Disturbance, RunSpec
from circuitkit.simulation.loop import run_and_watch
from circuitkit.study.cases import Case, ChangedError, Outcome, plan_of
from circuitkit.study.identity import all_versions
from circuitkit.study.spec import CLAMPED, RMS

# One thread each for the libraries below numpy: the processes share the cores already.
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL", "BLIS", "VECLIB", "NUMEXPR")}
_CONNECT_S = 10.0
_ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?([\w.-]+|\[[0-9A-Fa-f:.%]+\]):\d{1,5}")
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


@dataclass(frozen=True)
class Done:
    """A job that is done.

    Attributes:
        outcomes: One for each run, or what keeps that run's case from being run.
        environment: With what it was done: versions, and the backends of circuits where they are known.
    """

    outcomes: tuple[Outcome | CircuitkitError, ...]
    environment: Mapping[str, Mapping[str, str]]


def run_job(job: Job) -> Done:
    """Do a job with one thread.

    A run gets the same outcome, to the last bit, whatever the other runs of its job are.

    Raises:
        ChangedError: Something that determines its runs has changed.
        KeyboardInterrupt: Ctrl-C came; nothing is kept.
    """
    case = job.case
    known = all_versions(case.scenario, None, case.reference, case.controller)
    environment: dict[str, dict[str, str]] = {"versions": known, "backend": {}}
    return Done(_outcomes(case, job.specs, environment), environment)


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
    """A worker has ended, or cannot be reached."""


def _as_it_is(error: Exception) -> Exception:
    return error


@dataclass(frozen=True)
class Workers:
    """An executor for jobs; `open_workers` opens one for as long as a block lasts.

    Attributes:
        executor: Does the jobs.
        slots: How many jobs to hand in before waiting for one, as of now.
        explain: What the user is told when the executor itself fails.
    """

    executor: Executor
    slots: Callable[[], int]
    explain: Callable[[Exception], Exception] = _as_it_is

    def submit(self, job: Job) -> Future[Done]:
        """Hand in a job.

        Raises:
            WorkerError: A worker has ended.
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
            WorkerError: A worker has ended, or has other versions of what the bits depend on.
            ChangedError: Something that determines the runs has changed since they were asked for.
        """
        try:
            done = future.result()
        except CircuitkitError:
            raise
        except Exception as error:
            raise self.explain(error) from error
        require_same_environment(done, case)
        return done


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


def whole(work: Callable[[], T]) -> T:
    """Do something that a Ctrl-C shall not cut in two; it takes effect afterwards.

    Raises:
        KeyboardInterrupt: Ctrl-C came; the work is done.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        result = work()
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        raise KeyboardInterrupt
    return result


@contextmanager
def _holding_back(number: signal.Signals) -> Iterator[None]:
    """Have a signal wait in this thread, and in processes that it starts for as long as they live."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {number})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _WorkerProcess(SpawnProcess):
    """A process whose libraries use one thread; they read the environment when they are loaded."""

    def start(self) -> None:
        """Start; a Ctrl-C meanwhile takes effect afterwards, and the process itself never gets one.

        A process inherits which signals are held back, and this one is before it can say that it ignores it.
        """

        def begin() -> None:
            with environment(**_ONE_THREAD), _holding_back(signal.SIGINT):
                super(_WorkerProcess, self).start()

        whole(begin)


class _Context(SpawnContext):
    """Starts processes and remembers them: to say how one has ended, and to end them whatever they do."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: ANN401, N802 - the name that multiprocessing has
        """Prepare a process."""
        process = _WorkerProcess(*args, **kwargs)
        self.started.append(process)
        return process

    def explain(self, error: Exception) -> Exception:
        """Which process has ended, and how; the executor ends the others itself."""
        if not isinstance(error, BrokenExecutor):
            return error
        codes = [code for code in (self._exit_code(each) for each in self.started) if code is not None]
        code = next((code for code in codes if code != -signal.SIGTERM), codes[0] if codes else None)
        how = f"by signal {-code}" if code is not None and code < 0 else f"with exit code {code}"
        hint = (
            "the machine may be out of memory: take fewer --workers"
            if code is not None and code < 0
            else 'a script that starts workers needs `if __name__ == "__main__":` around its main part'
        )
        return WorkerError(f"a worker process has ended {how}; {hint}")

    @staticmethod
    def _exit_code(process: SpawnProcess) -> int | None:
        process.join(timeout=1.0)
        return process.exitcode

    def end(self) -> None:
        """End all processes at once."""
        for process in self.started:
            if process.is_alive():
                process.terminate()


def _leave_interrupts_to_the_parent() -> None:
    """Ctrl-C reaches all processes of a terminal; the one that started the sweep ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def environment(**values: str) -> Iterator[None]:
    """Have environment variables for a while, which processes that start meanwhile get, too."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _processes(count: int) -> Iterator[Workers]:
    context = _Context()
    executor = ProcessPoolExecutor(count, context, _leave_interrupts_to_the_parent)
    try:
        yield Workers(executor, lambda: count, context.explain)
    finally:
        # `shutdown` alone would wait for the jobs that are under way; Python 3.14 has `terminate_workers`.
        context.end()
        executor.shutdown(cancel_futures=True)


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

    def explain(error: Exception) -> Exception:
        return WorkerError(
            f"the Dask workers of '{address}' cannot do a job: {type(error).__name__}: {error}"
        )

    try:
        if not client.nthreads():
            message = f"the Dask scheduler at '{address}' has no workers; start some: dask worker {address}"
            raise WorkerError(message)
        yield Workers(client.get_executor(pure=False), slots, explain)
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
            message = f"a worker has {words}{shown}; allowed: as this process, {allowed}"
            raise WorkerError(message)


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def open_workers(count: int | None = None, scheduler: str | None = None) -> Iterator[Workers]:
    """Workers for as long as the block lasts.

    Args:
        count: Processes of this machine; by default one for each processor. One is this process itself.
        scheduler: Address of a Dask scheduler, such as `tcp://192.168.0.7:8786`, to use its workers instead.

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
            yield workers
    elif number == 1:
        yield Workers(ThisProcess(), lambda: 1)
    else:
        with _processes(number) as workers:
            yield workers
