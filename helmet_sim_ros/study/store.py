"""Results of a study on disk: finished rows survive any interruption, one file per chunk.

A results folder holds ``study.json`` (what the study is), ``rows/*.parquet`` (finished chunks, in
any order) and, once the study is finished, ``results.parquet`` and ``results.csv`` in its order.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from helmet_sim_ros.errors import SetupError, StudyError
from helmet_sim_ros.study.extra import need
from helmet_sim_ros.study.study import Row, Study, value_leaves
from helmet_sim_ros.study.worker import Outcome

#: Columns before the setup's and the criteria's.
FIXED = ("index", "id", "draw", "status", "error", "verdict")
#: Bytes a number takes in chunk, table and CSV together, an upper bound.
BYTES_PER_VALUE = 50
TEMPORARY = ".part"


class ResultStore:
    """The results folder of a study, locked while it is open.

    Attributes:
        folder: where it is.
        finished: index -> status of every row that is there.
    """

    def __init__(self, folder: Path, study: Study, retry_failed: bool = False) -> None:
        """Open the folder, or create it.

        Args:
            retry_failed: count rows with an error as not finished.

        Raises:
            SetupError: it holds results of another study, another process writes to it, it cannot
                be written, or the disk is too small.
            StudyError: what it holds cannot be read, or the extra ``study`` is not installed.
        """
        self.folder = folder
        self._arrow, self._parquet = need("pyarrow"), need("pyarrow.parquet")
        self._study = study
        self._schema = self._columns()
        self._rows = folder / "rows"
        try:
            self._rows.mkdir(parents=True, exist_ok=True)
            self._lock = open(folder / ".lock", "w")  # noqa: SIM115 - held until close()
        except OSError as error:
            raise SetupError.of("output", str(folder), f"cannot be written: {error}") from None
        try:
            self._take(study)
            self._check_space(study)
            self.finished = self._read_finished(retry_failed)
        except BaseException:
            self.close()
            raise
        self._next = 1 + max((int(path.stem) for path in self._chunks()), default=0)

    def __enter__(self) -> ResultStore:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others write to the folder."""
        self._lock.close()

    def append(self, rows: Sequence[tuple[Row, Outcome]]) -> None:
        """Keep finished rows; either all of them are kept or none.

        Raises:
            StudyError: they cannot be written; what was kept before stays.
        """
        data = [self._record(row, outcome) for row, outcome in rows]
        table = self._arrow.Table.from_pylist(data, schema=self._schema)
        path = self._rows / f"{self._next:08d}.parquet"
        self._write(path, lambda to: self._parquet.write_table(table, to))
        self._next += 1
        self.finished |= {row.index: outcome.status for row, outcome in rows}

    def finish(self) -> Any:
        """Write ``results.parquet`` and ``results.csv``; the chunks are then not needed any more.

        Returns:
            The table (``pyarrow.Table``), rows in the study's order.

        Raises:
            StudyError: a row is missing, or they cannot be written.
        """
        table = self.table()
        if len(table) != len(self._study):
            raise StudyError(f"{self.folder}: {len(table)} of {len(self._study)} rows are there")
        csv = need("pyarrow.csv")
        self._write(
            self.folder / "results.parquet", lambda to: self._parquet.write_table(table, to)
        )
        self._write(
            self.folder / "results.csv", lambda to: csv.write_csv(_flat(self._arrow, table), to)
        )
        for path in self._chunks():
            path.unlink()
        return table

    def table(self) -> Any:
        """Every finished row (``pyarrow.Table``), in the study's order; of a row computed again
        the latest."""
        parts = [self._read(path) for path in self._files()]
        table = self._arrow.concat_tables([self._schema.empty_table(), *parts])
        latest = {index: i for i, index in enumerate(table["index"].to_pylist())}
        return table.take([latest[index] for index in sorted(latest)])

    def _take(self, study: Study) -> None:
        """Make the folder this study's."""
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise SetupError.of(
                "output", str(self.folder), "another process is writing results there"
            ) from None
        for path in self.folder.rglob(f"*{TEMPORARY}"):
            path.unlink()
        note = self.folder / "study.json"
        if note.exists():
            self._refuse_another(note, study)
            return
        text = json.dumps(
            {
                "study": study.name,
                "identity": dict(study.identity),
                "file": study.file.model_dump(),
                "first case": study.row(0).values,
            },
            indent=1,
        )
        self._write(note, lambda to: to.write_text(text + "\n", encoding="utf-8"))

    def _refuse_another(self, note: Path, study: Study) -> None:
        try:
            there = json.loads(note.read_text(encoding="utf-8"))["identity"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SetupError.of("output", str(note), f"cannot be read: {error!r}") from None
        other = [key for key, digest in study.identity.items() if there.get(key) != digest]
        if other:
            raise SetupError.of(
                "output", str(self.folder),
                f"holds results of another study: other {', '.join(other)}; choose another place",
            )  # fmt: skip

    def _check_space(self, study: Study) -> None:
        needed = len(study) * len(self._schema) * BYTES_PER_VALUE
        free = shutil.disk_usage(self.folder).free
        if needed > free:
            raise SetupError.of(
                "output", str(self.folder),
                f"{len(study)} impacts need up to {needed / 1e6:.0f} MB, "
                f"{free / 1e6:.0f} MB are free",
            )  # fmt: skip

    def _read_finished(self, retry_failed: bool) -> dict[int, str]:
        finished: dict[int, str] = {}
        for path in self._files():
            part = self._read(path, ["index", "id", "status"]).to_pydict()
            for index, identity, status in zip(*part.values(), strict=True):
                if not index < len(self._study) or self._study.row(index).id != identity:
                    raise StudyError(f"{path}: row {index} is not of this study; delete the file")
                finished[index] = status
        if retry_failed:
            finished = {index: status for index, status in finished.items() if status == "ok"}
        return finished

    def _files(self) -> list[Path]:
        whole = self.folder / "results.parquet"
        return ([whole] if whole.exists() else []) + self._chunks()

    def _chunks(self) -> list[Path]:
        return sorted(self._rows.glob("*.parquet"))

    def _read(self, path: Path, columns: list[str] | None = None) -> Any:
        try:
            # One file, not a dataset: nothing is guessed from directory names.
            return self._parquet.ParquetFile(path).read(columns)
        except (OSError, ValueError) as error:
            raise StudyError(
                f"{path}: cannot be read ({error}); delete it, its rows are computed again"
            ) from None

    def _write(self, path: Path, write: Callable[[Path], object]) -> None:
        """Write a file under a temporary name, and give it its own once it is on the disk."""
        part = path.with_name(path.name + TEMPORARY)
        try:
            write(part)
            with open(part, "rb") as stream:
                os.fsync(stream.fileno())
            os.replace(part, path)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise StudyError(
                f"{path}: cannot be written: {error.strerror or error}; every row finished so far "
                "is kept, the same command goes on from there"
            ) from None

    def _columns(self) -> Any:
        arrow = self._arrow
        leaves = value_leaves()
        kinds = {float: arrow.float64(), int: arrow.int64(), bool: arrow.bool_()}
        kinds |= {str: arrow.string(), tuple: arrow.list_(arrow.float64())}
        texts = {name: arrow.string() for name in FIXED} | {
            "index": arrow.int64(),
            "draw": arrow.int64(),
        }
        fields = list(texts.items())
        fields += [(name, arrow.string()) for name in self._study.labels]
        fields += [(name, kinds[leaves[name].type]) for name in self._study.names]
        fields += [(name, arrow.float64()) for name in self._study.criteria]
        return arrow.schema(fields)

    def _record(self, row: Row, outcome: Outcome) -> dict[str, Any]:
        record = {
            "index": row.index,
            "id": row.id,
            "draw": row.draw,
            "status": outcome.status,
            "error": outcome.error,
            "verdict": outcome.verdict,
        }
        criteria = dict(zip(self._study.criteria, outcome.values, strict=False))
        return record | dict(row.labels) | dict(row.values) | criteria


def _flat(arrow: Any, table: Any) -> Any:
    """The table with lists as text, which CSV can hold."""
    for i, field in enumerate(table.schema):
        if arrow.types.is_list(field.type):
            text = [None if v is None else json.dumps(v) for v in table.column(i).to_pylist()]
            table = table.set_column(i, field.name, arrow.array(text, arrow.string()))
    return table
