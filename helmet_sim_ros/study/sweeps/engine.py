"""Where impacts are computed: in this process, or on the workers of a Dask cluster."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any, Generic, Protocol, TypeVar

from helmet_sim_ros.errors import SetupError, StudyError
from helmet_sim_ros.extra import need
from helmet_sim_ros.study.sweeps.worker import Job, Outcome, run_chunk, warm_up

#: Chunks per worker that are with the scheduler at once: one runs, the next ones wait. It bounds
#: what the scheduler must hold, whatever the size of the study.
CHUNKS_PER_WORKER = 3
#: How long a cluster may take to answer and to have a worker [s].
CONNECT_TIMEOUT = 15.0

Tag = TypeVar("Tag")


@dataclass(frozen=True)
class Chunk(Generic[Tag]):
    """Impacts that are computed together, with a tag of the caller's to know them by."""

    tag: Tag
    setups: tuple[Mapping[str, object], ...]


class Engine(Protocol):
    """Computes chunks."""

    @property
    def workers(self) -> int:
        """Impacts that run at the same time."""

    def run(
        self, job: Job, chunks: Iterable[Chunk[Tag]]
    ) -> Iterator[tuple[Chunk[Tag], list[Outcome]]]:
        """Every chunk with its outcomes, as they finish, in any order.

        A chunk whose worker dies is computed again elsewhere; one that kills every worker is taken
        apart, and the impact that does it fails.

        Raises:
            StudyError: the cluster is gone.
        """


@contextmanager
def open_engine(workers: int | None = None, scheduler: str | None = None) -> Iterator[Engine]:
    """An engine, closed on exit.

    Args:
        workers: processes on this machine; unset: one per core; 0: this process computes, without
            Dask.
        scheduler: address of a running Dask scheduler (``tcp://host:8786``) instead.

    Raises:
        SetupError: the scheduler does not answer, has no workers, or workers of other versions.
        MissingExtraError: the extra ``study`` is not installed.
    """
    if scheduler is None and workers == 0:
        yield _Here()
        return
    distributed = need("distributed", "study")
    if scheduler is not None:
        with _connected(distributed, scheduler) as client:
            yield _Dask(distributed, client)
        return
    count = workers or len(os.sched_getaffinity(0))
    saturation = {"distributed.scheduler.worker-saturation": 1.0}
    with need("dask", "study").config.set(saturation), ExitStack() as stack:
        with _deaf_children():
            cluster = stack.enter_context(distributed.LocalCluster(
                n_workers=count, threads_per_worker=1, dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            ))  # fmt: skip
        yield _Dask(distributed, stack.enter_context(distributed.Client(cluster)))


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Threads and processes that start in this block, and theirs, do not hear of Ctrl-C, which a
    terminal sends to all of them: this thread does, and ends them."""
    resource_tracker.ensure_running()  # starting it later would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Here:
    """Computes in this process."""

    workers = 1

    def run(
        self, job: Job, chunks: Iterable[Chunk[Tag]]
    ) -> Iterator[tuple[Chunk[Tag], list[Outcome]]]:
        for chunk in chunks:
            yield chunk, run_chunk(job, chunk.setups)


class _Dask:
    """Computes on the workers of a Dask cluster."""

    def __init__(self, distributed: Any, client: Any) -> None:
        self._distributed, self._client = distributed, client
        self._check_workers()

    @property
    def workers(self) -> int:
        return max(1, int(sum(self._client.nthreads().values())))

    def run(
        self, job: Job, chunks: Iterable[Chunk[Tag]]
    ) -> Iterator[tuple[Chunk[Tag], list[Outcome]]]:
        suspects: list[Chunk[Tag]] = []
        yield from self._run(job, iter(chunks), CHUNKS_PER_WORKER * self.workers, suspects)
        # One impact at a time, so that no other one is blamed for the death of its worker.
        singles = (Chunk((c, i), (s,)) for c in suspects for i, s in enumerate(c.setups))
        fatal: list[Chunk[tuple[Chunk[Tag], int]]] = []
        parts: dict[int, dict[int, Outcome]] = {id(chunk): {} for chunk in suspects}
        for single, outcomes in self._run(job, singles, 1, fatal):
            chunk, i = single.tag
            parts[id(chunk)][i] = outcomes[0]
        for single in fatal:
            chunk, i = single.tag
            parts[id(chunk)][i] = Outcome("failed", "the worker process dies of this impact")
        for chunk in suspects:
            found = parts[id(chunk)]
            yield chunk, [found[i] for i in range(len(chunk.setups))]

    def _run(
        self, job: Job, chunks: Iterator[Chunk[Tag]], in_flight: int, suspects: list[Chunk[Tag]]
    ) -> Iterator[tuple[Chunk[Tag], list[Outcome]]]:
        waiting: dict[Any, Chunk[Tag]] = {}
        finished = self._distributed.as_completed()

        def submit() -> None:
            chunk = next(chunks, None)
            if chunk is not None:
                future = self._client.submit(run_chunk, job, chunk.setups, pure=False)
                waiting[future] = chunk
                finished.add(future)

        for _ in range(in_flight):
            submit()
        while waiting:
            future = next(finished)
            chunk = waiting.pop(future)
            submit()
            try:
                # Its worker may have died since: then the chunk is computed again, and waited for.
                outcomes = future.result()
            except self._distributed.KilledWorker:
                suspects.append(chunk)
            except CancelledError:
                raise StudyError(
                    "the cluster is gone: its scheduler dropped the study's work"
                ) from None
            except Exception as error:
                raise StudyError(f"the cluster failed: {type(error).__name__}: {error}") from error
            else:
                yield chunk, outcomes

    def _check_workers(self) -> None:
        """Import the physics everywhere, and refuse workers whose results would differ."""
        here = warm_up()
        try:
            everywhere = self._client.run(warm_up)
        except Exception as error:
            raise SetupError.of(
                "scheduler", self._client.scheduler.address,
                f"its workers cannot run helmet_sim_ros: {type(error).__name__}: {error}",
            ) from None  # fmt: skip
        for worker, there in everywhere.items():
            if there != here:
                raise SetupError.of(
                    "scheduler", worker, f"this worker has {there}, this process {here}"
                )


@contextmanager
def _connected(distributed: Any, address: str) -> Iterator[Any]:
    """A client of a running scheduler that has at least one worker."""
    try:
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        raise SetupError.of("scheduler", address, f"cannot be reached: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_TIMEOUT)
        except TimeoutError:
            raise SetupError.of("scheduler", address, "has no workers") from None
        yield client
