"""Where jobs are done: in this process, in processes of this machine, or on a Dask scheduler's workers."""

from __future__ import annotations

import os
import re
import signal
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any, final

from circuitkit.base.errors import CircuitkitError, MissingDependencyError, listing
from circuitkit.study.jobs import Done, Job, run_job, versions

# One thread each for the libraries below numpy: the processes share the cores already.
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL", "BLIS", "VECLIB", "NUMEXPR")}
_CONNECT_S = 10.0
_ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?([\w.-]+|\[[0-9A-Fa-f:.%]+\]):\d{1,5}")
_MOST_WORKERS = 1024


class PoolError(CircuitkitError):
    """A worker has ended, or cannot be reached."""


class Pool(ABC):
    """Workers that take jobs; use it in a `with` block, as `open_pool` gives it."""

    @property
    @abstractmethod
    def workers(self) -> int:
        """How many jobs can be under way at once."""

    @property
    def slots(self) -> int:
        """How many jobs to hand in before waiting for one."""
        return self.workers

    @property
    @abstractmethod
    def under_way(self) -> int:
        """How many jobs have been handed in and not been taken."""

    @abstractmethod
    def submit(self, job: Job) -> None:
        """Hand in a job."""

    @abstractmethod
    def next(self) -> Done:
        """Wait for a job that is done, and take it.

        Raises:
            PoolError: A worker has ended.
        """

    @abstractmethod
    def close(self) -> None:
        """End the workers at once, whatever they do."""


@final
class ThisProcess(Pool):
    """Does the jobs itself, one after the other, when they are waited for."""

    def __init__(self) -> None:
        self._jobs: deque[Job] = deque()

    @property
    def workers(self) -> int:
        """One."""
        return 1

    @property
    def under_way(self) -> int:
        """How many jobs wait."""
        return len(self._jobs)

    def submit(self, job: Job) -> None:
        """Keep a job until it is waited for."""
        self._jobs.append(job)

    def next(self) -> Done:
        """Do the oldest job."""
        return run_job(self._jobs.popleft())

    def close(self) -> None:
        """Forget the jobs."""
        self._jobs.clear()


@final
class Processes(Pool):
    """Processes of this machine; each does one job at a time."""

    def __init__(self, workers: int) -> None:
        context = get_context("spawn")
        self._idle: list[Connection] = []
        self._busy: dict[Connection, int] = {}
        self._processes: dict[Connection, Any] = {}
        with environment(**_ONE_THREAD):
            for _ in range(workers):
                mine, theirs = context.Pipe()
                process = context.Process(target=_work, args=(theirs,), daemon=True)
                process.start()
                theirs.close()
                self._idle.append(mine)
                self._processes[mine] = process

    @property
    def workers(self) -> int:
        """How many processes there are."""
        return len(self._processes)

    @property
    def under_way(self) -> int:
        """How many processes have a job."""
        return len(self._busy)

    def submit(self, job: Job) -> None:
        """Send a job to a process without one; there is one as long as no more than `slots` are handed in."""
        connection = self._idle.pop()
        try:
            connection.send(job)
        except OSError as error:
            raise self._ended(connection) from error
        self._busy[connection] = job.number

    def next(self) -> Done:
        """Wait for the first of the jobs."""
        for connection in wait(list(self._busy)):
            assert isinstance(connection, Connection)
            try:
                done = connection.recv()
            except (EOFError, OSError) as error:
                raise self._ended(connection) from error
            del self._busy[connection]
            self._idle.append(connection)
            if isinstance(done, BaseException):
                raise done
            assert isinstance(done, Done)
            return done
        message = "there is no job to wait for"
        raise PoolError(message)

    def close(self) -> None:
        """End the processes at once."""
        for process in self._processes.values():
            process.terminate()
        for connection, process in self._processes.items():
            process.join()
            connection.close()
        self._processes.clear()

    def _ended(self, connection: Connection) -> PoolError:
        process = self._processes[connection]
        process.join(timeout=1.0)
        code = process.exitcode
        how = f"by signal {-code}" if code is not None and code < 0 else f"with exit code {code}"
        hint = (
            "the machine may be out of memory: take fewer --workers"
            if code is not None and code < 0
            else 'a script that starts workers needs `if __name__ == "__main__":` around its main part'
        )
        return PoolError(f"a worker process has ended {how}; {hint}")


def _work(connection: Connection) -> None:
    """What a process does: jobs, until nobody sends one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all; who started the sweep ends it
    while True:
        try:
            job = connection.recv()
        except (EOFError, OSError):
            return
        answer: Done | BaseException
        try:
            answer = run_job(job)
        except Exception as error:
            answer = error
        try:
            connection.send(answer)
        except (BrokenPipeError, OSError):
            return


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


@final
class DaskWorkers(Pool):
    """Workers of a Dask scheduler; a worker that is lost has its jobs done by another one."""

    def __init__(self, address: str) -> None:
        """Connect to a scheduler.

        Args:
            address: Such as `tcp://192.168.0.7:8786`.

        Raises:
            MissingDependencyError: distributed is not installed.
            PoolError: There is no scheduler at this address, or it has no workers.
        """
        try:
            from distributed import Client, as_completed
        except ImportError as error:
            package, extra = "distributed", "cluster"
            raise MissingDependencyError(package, extra, "a sweep on a Dask scheduler") from error
        if not _ADDRESS.fullmatch(address):  # or distributed leaves a client behind that never closes
            allowed = "the address of a Dask scheduler, such as tcp://192.168.0.7:8786"
            message = f"found '{address}'; allowed: {allowed}"
            raise PoolError(message)
        try:
            client: Any = Client
            self._client = client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            message = (
                f"cannot reach a Dask scheduler at '{address}': {error}; "
                "start one with `dask scheduler`, and workers with `dask worker tcp://HOST:8786 --nthreads 1`"
            )
            raise PoolError(message) from error
        self._address = address
        completed: Any = as_completed
        self._futures = completed(loop=self._client.loop)
        if not self.workers:
            self._client.close()
            message = f"the Dask scheduler at '{address}' has no workers; start some: dask worker {address}"
            raise PoolError(message)

    @property
    def workers(self) -> int:
        """Threads of all workers that there are now."""
        return sum(self._client.nthreads().values())

    @property
    def slots(self) -> int:
        """One job under way and one waiting for each thread, so that none waits for us."""
        return max(2 * self.workers, 1)

    @property
    def under_way(self) -> int:
        """How many jobs the scheduler has."""
        return int(self._futures.count())

    def submit(self, job: Job) -> None:
        """Send a job to the scheduler."""
        self._futures.add(self._client.submit(run_job, job, pure=False))

    def next(self) -> Done:
        """Wait for the first of the jobs."""
        future = next(self._futures)
        try:
            done = future.result()
        except CircuitkitError:
            raise
        except Exception as error:
            message = (
                f"the Dask workers of '{self._address}' cannot do a job: {type(error).__name__}: {error}"
            )
            raise PoolError(message) from error
        assert isinstance(done, Done)
        require_same_versions(done)
        return done

    def close(self) -> None:
        """Take back what is under way, and leave the scheduler and its workers as they are."""
        self._futures.clear()
        self._client.close()


def require_same_versions(done: Done) -> None:
    """Refuse outcomes that other versions may have made otherwise.

    Raises:
        PoolError: They are not those of this process.
    """
    ours = versions()
    if other := [name for name in ours if done.versions.get(name) != ours[name]]:
        found = listing(f"{name} {done.versions.get(name)}" for name in other)
        allowed = listing(f"{name} {ours[name]}" for name in other)
        message = f"a Dask worker has {found}; allowed: as this process, {allowed}"
        raise PoolError(message)


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def open_pool(workers: int | None = None, scheduler: str | None = None) -> Iterator[Pool]:
    """Workers for as long as the block lasts.

    Args:
        workers: Processes of this machine; by default one for each processor. One is this process itself.
        scheduler: Address of a Dask scheduler, such as `tcp://192.168.0.7:8786`, to use its workers instead.

    Raises:
        CircuitkitError: `workers` is less than 1, or given together with `scheduler`.
        MissingDependencyError: `scheduler` needs distributed, which is not installed.
        PoolError: The scheduler cannot be reached.
    """
    if scheduler is not None and workers is not None:
        message = "the workers of a scheduler are its own; give workers or scheduler, not both"
        raise CircuitkitError(message)
    if workers is not None and not 1 <= workers <= _MOST_WORKERS:
        message = f"found {workers} workers; allowed: 1 to {_MOST_WORKERS}"
        raise CircuitkitError(message)
    count = workers or processors()
    pool: Pool
    if scheduler is not None:
        pool = DaskWorkers(scheduler)
    else:
        pool = ThisProcess() if count == 1 else Processes(count)
    try:
        yield pool
    finally:
        pool.close()
