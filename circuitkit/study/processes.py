"""Processes of this machine as an executor: one that dies or hangs takes no other's work along.

Each process is a `ProcessPoolExecutor` of its own, because such a pool breaks as a whole when one of its
processes dies. So it is known whose work is lost, and only that one is started anew.
"""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from circuitkit.base.signals import BY_SIGNAL, tidied_up_when_ended, whole

# One thread each for the libraries below numpy: the processes share the cores already.
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL", "BLIS", "VECLIB", "NUMEXPR")}
_LOOK_S = 0.01
_GRACE_S = 5.0  # for a process to tidy up before it is killed

T = TypeVar("T")


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
        """Start; being told to end meanwhile takes effect afterwards, and the process itself gets no Ctrl-C.

        A process inherits which signals are held back, and this one is before it can say that it ignores it.
        """

        def begin() -> None:
            with environment(**_ONE_THREAD), _holding_back(signal.SIGINT):
                super(_WorkerProcess, self).start()

        whole(begin)


class _Context(SpawnContext):
    """Starts processes and remembers the last one."""

    process: SpawnProcess | None = None

    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: ANN401, N802 - the name that multiprocessing has
        """Prepare a process."""
        self.process = _WorkerProcess(*args, **kwargs)
        return self.process


def this_process() -> str:
    """The name of this process, such as `process 4711 on 'lab7'`."""
    return f"process {os.getpid()} on '{socket.gethostname()}'"


def _prepare() -> None:
    """Make this process one of several that a parent has: it ends with its parent.

    Ctrl-C reaches all processes of a terminal; the one that started the others ends them.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = parent_process()
    if parent is None:
        return
    parent.join()
    timer = threading.Timer(_GRACE_S, os._exit, (BY_SIGNAL + signal.SIGTERM,))
    timer.daemon = True
    timer.start()
    os.kill(os.getpid(), signal.SIGTERM)


def _until_told_to_end(fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> T:  # noqa: ANN401 - any
    """Call a function; if it ends the process, or that is told to end, the pool has no say in it."""
    try:
        with tidied_up_when_ended():
            return fn(*args, **kwargs)
    except SystemExit as end:
        os._exit(end.code if isinstance(end.code, int) else 1)


class _Worker:
    """A process, or the one that takes its place."""

    def __init__(self) -> None:
        self.jobs: set[Future[Any]] = set()
        self._renew()

    def _renew(self) -> None:
        self.context = _Context()
        self._pool = ProcessPoolExecutor(1, self.context, _prepare)

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:  # noqa: ANN401 - any
        """Hand in work."""
        try:
            future = self._pool.submit(_until_told_to_end, fn, *args, **kwargs)
        except BrokenExecutor:
            self._pool.shutdown(wait=False)
            self._renew()
            future = self._pool.submit(_until_told_to_end, fn, *args, **kwargs)
        self.jobs.add(future)
        future.add_done_callback(self.jobs.discard)
        return future

    def shutdown(self) -> None:
        """Wait for the process to end."""
        self._pool.shutdown(cancel_futures=True)


def _kill(processes: Sequence[SpawnProcess]) -> None:
    for each in processes:
        each.kill()


class Processes(Executor):
    """Processes of this machine."""

    def __init__(self, count: int) -> None:
        """Take a number of processes; each starts with its first work."""
        self._workers = [_Worker() for _ in range(count)]
        self._doing: WeakKeyDictionary[Future[Any], SpawnProcess] = WeakKeyDictionary()

    @classmethod
    def start_one(cls) -> None:
        """Start a process and end it, to see how long that takes."""
        with cls(1) as processes:
            processes.submit(this_process).result()

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:  # noqa: ANN401 - any
        """Hand in work, to the process that has least."""
        worker = min(self._workers, key=lambda each: len(each.jobs))
        future = worker.submit(fn, *args, **kwargs)
        if worker.context.process is not None:
            self._doing[future] = worker.context.process
        return future

    def name(self, future: Future[Any]) -> str:
        """Who does it, such as `worker process 4711 on 'lab7'`."""
        return f"worker process {self._doing[future].pid} on '{socket.gethostname()}'"

    def how_it_ended(self, future: Future[Any]) -> tuple[str, bool]:
        """How the process has ended whose work is lost, and whether a signal did it."""
        process = self._doing[future]
        until = time.monotonic() + _GRACE_S
        # The pool waits for it, too: for a moment, it may know the code, and this thread not.
        while (code := process.exitcode) is None and time.monotonic() < until:
            time.sleep(_LOOK_S)
        number = -code if code is not None and code < 0 else (code or 0) - BY_SIGNAL
        if number > 0:
            return f"was ended by signal {number} ({signal.Signals(number).name})", True
        return f"ended with exit code {code}", False

    def kill(self, future: Future[Any]) -> None:
        """Kill the process that does it, which may be stopped or in an endless loop; the work is lost."""
        self._doing[future].kill()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes at once, whatever they do; each may tidy up."""
        del wait, cancel_futures  # nobody waits for results any more
        processes = [each.context.process for each in self._workers if each.context.process is not None]
        alive = [each for each in processes if each.pid is not None]  # the others never started
        for process in alive:
            if process.is_alive():
                process.terminate()
        killer = threading.Timer(_GRACE_S, lambda: _kill(alive))
        killer.start()
        for worker in self._workers:
            worker.shutdown()
        for process in alive:
            process.join()
        killer.cancel()
