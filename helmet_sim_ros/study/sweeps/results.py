"""Results of a study on disk: finished rows survive any interruption, one file per chunk.

A results folder holds ``study.json`` (what the study is), ``rows/*.parquet`` (finished chunks, in
any order) and, once the study is finished, ``results.parquet`` and ``results.csv`` in its order.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from helmet_sim_ros.errors import SetupError, StudyError
from helmet_sim_ros.extra import need
from helmet_sim_ros.study.sweeps.folder import StudyFolder
from helmet_sim_ros.study.sweeps.study import FIXED, Row, Study, value_leaves
from helmet_sim_ros.study.sweeps.worker import Outcome

#: Bytes a number takes in chunk, table and CSV together, an upper bound.
BYTES_PER_VALUE = 50


class ResultStore:
    """The results folder of a study, locked while it is open.

    Attributes:
        finished: index -> status of every row that is there.
    """

    def __init__(self, path: Path, study: Study, retry_failed: bool = False) -> None:
        """Open the folder, or create it.

        Args:
            retry_failed: count rows with an error as not finished.

        Raises:
            SetupError: it holds results of another study, another process writes to it, it cannot
                be written, or the disk is too small.
            StudyError: what it holds cannot be read.
            MissingExtraError: the extra ``study`` is not installed.
        """
        self._arrow, self._parquet = need("pyarrow", "study"), need("pyarrow.parquet", "study")
        self._study = study
        self._schema = self._columns()
        self._rows = path / "rows"
        note = {"study": study.name, "file": study.file.model_dump()}
        self._folder = StudyFolder(path, study.identity, note)
        try:
            self._check_space()
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
        self._folder.close()

    def append(self, rows: Sequence[tuple[Row, Outcome]]) -> None:
        """Keep finished rows; either all of them are kept or none.

        Raises:
            StudyError: they cannot be written; what was kept before stays.
        """
        data = [self._record(row, outcome) for row, outcome in rows]
        table = self._arrow.Table.from_pylist(data, schema=self._schema)
        path = self._rows / f"{self._next:08d}.parquet"
        self._folder.write(path, lambda to: self._parquet.write_table(table, to))
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
            raise StudyError(
                f"{self._folder.path}: {len(table)} of {len(self._study)} rows are there"
            )
        csv = need("pyarrow.csv", "study")
        self._folder.write(
            self._folder.path / "results.parquet", lambda to: self._parquet.write_table(table, to)
        )
        self._folder.write(
            self._folder.path / "results.csv",
            lambda to: csv.write_csv(_flat(self._arrow, table), to),
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

    def _check_space(self) -> None:
        needed = len(self._study) * len(self._schema) * BYTES_PER_VALUE
        free = shutil.disk_usage(self._folder.path).free
        if needed > free:
            raise SetupError.of(
                "output", str(self._folder.path),
                f"{len(self._study)} {self._study.unit} need up to {needed / 1e6:.0f} MB, "
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
        whole = self._folder.path / "results.parquet"
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

    def _columns(self) -> Any:
        arrow = self._arrow
        leaves = value_leaves()
        kinds = {float: arrow.float64(), int: arrow.int64(), bool: arrow.bool_()}
        kinds |= {str: arrow.string(), tuple: arrow.list_(arrow.float64())}
        texts = {name: arrow.string() for name in FIXED} | {
            "index": arrow.int64(),
            "draw": arrow.int64(),
            "notes": arrow.list_(arrow.string()),
        }
        fields = list(texts.items())
        fields += [(name, arrow.string()) for name in self._study.labels]
        fields += [(name, kinds[leaves[name].type]) for name in self._study.names]
        fields += [(name, arrow.float64()) for name in self._study.criteria]
        return arrow.schema(fields)

    def _record(self, row: Row, outcome: Outcome) -> dict[str, object]:
        record = {
            "index": row.index,
            "id": row.id,
            "draw": row.draw,
            "status": outcome.status,
            "error": outcome.error,
            "verdict": outcome.verdict,
            "notes": list(outcome.notes),
        }
        criteria = dict(zip(self._study.criteria, outcome.values, strict=False))
        return record | dict(row.labels) | dict(row.values) | criteria


def _flat(arrow: Any, table: Any) -> Any:
    """The table with lists as text, which CSV can hold."""
    for i, field in enumerate(table.schema):
        if arrow.types.is_list(field.type):
            numbers = arrow.types.is_floating(field.type.value_type)
            told = json.dumps if numbers else "; ".join
            text = [None if v is None else told(v) for v in table.column(i).to_pylist()]
            table = table.set_column(i, field.name, arrow.array(text, arrow.string()))
    return table
