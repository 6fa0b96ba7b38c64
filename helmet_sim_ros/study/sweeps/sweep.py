"""Sweeps: every impact of a study, computed once, whatever interrupts it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from helmet_sim_ros.study.sweeps.engine import Chunk, open_engine
from helmet_sim_ros.study.sweeps.results import ResultStore
from helmet_sim_ros.study.sweeps.study import Row, Study, load_study
from helmet_sim_ros.study.sweeps.worker import Job

#: Most impacts per chunk: some seconds of work, the most that a killed worker costs.
MAX_CHUNK = 100

#: A number of a note: rows whose notes differ in nothing else have the same kind of note.
NUMBER = re.compile(r"(?<!\w)[-+]?\d+(\.\d+)?(?!\w)")

#: Called with finished, total and failed rows.
Progress = Callable[[int, int, int], None]


@dataclass(frozen=True)
class SweepResult:
    """The results of a sweep.

    Attributes:
        study: what was computed.
        folder: where ``results.parquet`` and ``results.csv`` are.
        table: the same as ``pyarrow.Table``; ``table.to_pandas()`` for pandas.
        computed: rows that this call computed; the others were there already.
    """

    study: Study
    folder: Path
    table: Any
    computed: int

    @property
    def failed(self) -> int:
        """Rows with an error."""
        return sum(status != "ok" for status in self.table["status"].to_pylist())

    @property
    def notes(self) -> dict[str, int]:
        """How many rows have each kind of note (their column ``notes`` with its numbers left out),
        the most frequent first."""
        rows = [{NUMBER.sub("…", note) for note in row} for row in self.table["notes"].to_pylist()]
        return dict(Counter(kind for row in rows for kind in sorted(row)).most_common())

    def worst(self, criterion: str = "peak_g", count: int | None = None) -> list[Row]:
        """Rows by falling value of a criterion, failed ones left out."""
        values = self.table[criterion].to_pylist()
        order = sorted((i for i, v in enumerate(values) if v is not None), key=lambda i: -values[i])
        return [self.study.row(i) for i in order[:count]]

    def spread(self, count: int, criterion: str = "peak_g") -> list[Row]:
        """Rows at even steps through the ranks of a criterion, failed ones left out: as the whole
        study is distributed, in the order of the study."""
        ranked = self.worst(criterion)
        taken = {int((k + 0.5) * len(ranked) / count) for k in range(count)} if ranked else ()
        return sorted((ranked[i] for i in taken), key=lambda row: row.index)


def sweep(
    study: Study | str | Path,
    output: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    retry_failed: bool = False,
    chunk: int | None = None,
) -> SweepResult:
    """Compute every impact of a study that is not in the results folder yet.

    The results do not depend on workers, chunks or interruptions, bit for bit, on processors of
    one kind. Called from a script, that script needs the usual
    ``if __name__ == "__main__":``, because workers are fresh processes.

    Args:
        study: a study, its name in ``config/studies``, or the path of a YAML file.
        output: results folder; unset: ``NAME.results`` in the working directory.
        workers: processes on this machine; unset: one per core; 0: this process, without Dask.
        scheduler: address of a running Dask scheduler instead.
        progress: called after every chunk.
        retry_failed: compute rows with an error again.
        chunk: impacts per chunk; unset: so that every worker gets several, at most 100.

    Raises:
        SetupError: bad study, foreign results in the folder, or no such scheduler; before the
            first impact.
        StudyError: stopped on the way (disk full, cluster gone); finished rows are kept, and the
            same call goes on from there.
    """
    study = study if isinstance(study, Study) else load_study(study)
    folder = results_folder(study, output)
    with ResultStore(folder, study, retry_failed) as store:
        left = len(study) - len(store.finished)
        if left:
            with open_engine(workers, scheduler) as engine:
                size = chunk or max(1, min(MAX_CHUNK, left // (4 * engine.workers)))
                job = Job(study.file.standard, study.criteria)
                _tell(progress, study, store)
                for part, outcomes in engine.run(job, _chunks(study, set(store.finished), size)):
                    store.append(list(zip(part.tag, outcomes, strict=True)))
                    _tell(progress, study, store)
        table = store.finish()
    return SweepResult(study, folder, table, left)


def results_folder(study: Study, output: str | Path | None) -> Path:
    """Where a sweep keeps its results; arguments as :func:`sweep`."""
    return Path(f"{study.name}.results" if output is None else output)


def _chunks(study: Study, finished: set[int], size: int) -> Iterator[Chunk[tuple[Row, ...]]]:
    rows: list[Row] = []
    for row in study.rows():
        if row.index not in finished:
            rows.append(row)
        if len(rows) == size:
            yield _chunk(rows)
            rows = []
    if rows:
        yield _chunk(rows)


def _chunk(rows: list[Row]) -> Chunk[tuple[Row, ...]]:
    return Chunk(tuple(rows), tuple(row.values for row in rows))


def _tell(progress: Progress | None, study: Study, store: ResultStore) -> None:
    if progress is not None:
        failed = sum(status != "ok" for status in store.finished.values())
        progress(len(store.finished), len(study), failed)
