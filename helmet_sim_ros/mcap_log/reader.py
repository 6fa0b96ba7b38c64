"""Read the impacts of a log back, exactly, without ROS, and only what is asked for."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.index import Entry, ImpactIndex, clock_warnings, parsed_setup
from helmet_sim_ros.mcap_log.layout import BINARY, FORMAT_VERSION, IMPACT, RECOVERED, RUN
from helmet_sim_ros.mcap_log.source import McapSource

if TYPE_CHECKING:
    import pandas as pd

#: Impacts whose samples a log keeps in memory.
_KEPT = 2


class LoggedImpact:
    """A complete impact of a log; samples and criteria are read when they are used.

    Attributes:
        impact_id: unique over all impacts of all processes.
        start_time: simulation time of its first sample [s].
        samples: number of samples.
    """

    def __init__(self, log: ImpactLog, entry: Entry) -> None:
        self._log, self._entry = log, entry
        self.impact_id = entry.impact_id
        self.start_time = entry.start_time
        self.samples = entry.samples

    def __repr__(self) -> str:
        return f"<impact {self.impact_id} of {self._log.path.name}>"

    @property
    def record(self) -> ImpactRecord:
        """Every sample, bit for bit.

        Raises:
            LogError: the samples are damaged.
        """
        return self._log._content(self._entry)[0]

    @cached_property
    def setup(self) -> Mapping[str, Any]:
        """The complete impact setup by dotted names."""
        text = self._entry.notes.get("setup")
        return self.record.setup if text is None else parsed_setup(text, self._log.path)

    @property
    def model(self) -> str | None:
        """The compiled model as MJCF text, None where the log has none.

        Raises:
            LogError: its attachment is damaged, and so are the samples that it came with.
        """
        return self._model[0]

    @property
    def model_problem(self) -> str:
        """Why the logged model is not the one that its name says; empty if it is."""
        try:
            return self._model[1]
        except LogError as error:
            return str(error)

    @cached_property
    def model_hash(self) -> str:
        """SHA-256 of :attr:`model`, its first 12 digits; empty where the log has none."""
        return "" if self.model is None else _hash(self.model)

    @cached_property
    def _model(self) -> tuple[str | None, str]:
        """The model and what is wrong with it; that of the samples if its attachment is damaged."""
        name = self._entry.notes.get("model")
        if name is None:
            return self._log._content(self._entry)[1], ""
        try:
            text = self._log.attachment(name)
        except LogError as error:
            model = self._log._content(self._entry)[1]
            return model, f"{error}; the model that came with the samples is shown"
        if name == f"model_{_hash(text)}.xml":
            return text, ""
        return text, f"the model {name} was changed: its hash is now {_hash(text)}"

    @cached_property
    def logged(self) -> Evaluation | None:
        """The criteria as they were logged; None if the log has none for this impact.

        Raises:
            LogError: what was logged is no result, in words.
        """
        return self._log._index.logged(self._entry)

    @cached_property
    def evaluation(self) -> Evaluation:
        """The criteria: as logged, or computed from the samples where none were logged."""
        return self.evaluate() if self.logged is None else self.logged

    def evaluate(self, standard: str | None = None) -> Evaluation:
        """The criteria computed from the logged samples.

        Args:
            standard: as for :func:`helmet_sim_ros.evaluate`.
        """
        return evaluate(self.record, standard)

    def frame(self) -> pd.DataFrame:
        """The samples as a pandas table, one column per component, the index is time [s]."""
        return self.record.frame()


class ImpactLog:
    """A finished log. Opening it reads its index only.

    Attributes:
        path: the file.
        impacts: every complete impact, in the order of the file.
        problems: for every impact that is not complete, why.
        warnings: what a reader should know about the whole log.
    """

    def __init__(self, path: str | Path) -> None:
        """Open a log; see :func:`open_log`."""
        self.path = Path(path)
        self._source = McapSource(self.path)
        self._indexed = {index.name: index for index in self._source.metadata_index}
        self._refuse_newer()
        self._index = ImpactIndex(self._source)
        entries = self._index.entries
        self.impacts = tuple(LoggedImpact(self, e) for e in entries if not e.problem)
        self.problems = tuple(e.problem for e in entries if e.problem)
        self.warnings = (*self._unprotected(), *clock_warnings(entries))
        self._content = lru_cache(_KEPT)(self._index.read)

    def __repr__(self) -> str:
        return f"<log {self.path}: {len(self.impacts)} impacts>"

    def __len__(self) -> int:
        return len(self.impacts)

    def __iter__(self) -> Iterator[LoggedImpact]:
        return iter(self.impacts)

    def __getitem__(self, key: int | str) -> LoggedImpact:
        """An impact by its position or its id.

        Raises:
            KeyError: no such id.
            IndexError: no such position.
        """
        if isinstance(key, int):
            return self.impacts[key]
        for impact in self.impacts:
            if impact.impact_id == key:
                return impact
        raise KeyError(key)

    @cached_property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Name -> values of each metadata record (``run``, ``impact/ID``)."""
        return {name: self._source.metadata(index) for name, index in self._indexed.items()}

    @cached_property
    def run(self) -> dict[str, str]:
        """When, where and with which versions the log was made; empty for a bag."""
        return self._source.metadata(self._indexed[RUN]) if RUN in self._indexed else {}

    @property
    def library(self) -> str:
        """What wrote the file."""
        return str(self.run.get("library", self._source.library))

    @property
    def attachments(self) -> dict[str, str]:
        """Name -> text of each attachment that is text (``scenario.yaml``, models, foams)."""
        return {
            name: self.attachment(name)
            for name, media_type in self._source.attachments.items()
            if media_type != BINARY
        }

    def attachment(self, name: str) -> str:
        """The text of one attachment.

        Raises:
            LogError: there is none of this name, or it is damaged.
        """
        return self._source.attachment(name).decode("utf-8", "replace")

    @property
    def files(self) -> tuple[str, ...]:
        """Names of all attachments, also of those that are no text (geometries of helmets)."""
        return tuple(self._source.attachments)

    def file(self, name: str) -> bytes:
        """The content of one attachment, as the file had it.

        Raises:
            LogError: there is none of this name, or it is damaged.
        """
        return self._source.attachment(name)

    def setup(self, impact_id: str) -> dict[str, Any]:
        """The setup of an impact, complete or not, as recorded in the metadata.

        Raises:
            LogError: the log has no such impact.
        """
        notes = self._indexed.get(IMPACT + impact_id)
        text = "" if notes is None else self._source.metadata(notes).get("setup", "")
        if not text:
            raise LogError(f"{self.path}: no setup of an impact {impact_id!r}")
        return parsed_setup(text, self.path)

    def frame(self) -> pd.DataFrame:
        """The results as a pandas table: one row per impact, setup and criteria as columns."""
        from helmet_sim_ros.mcap_log.frames import result_frame

        return result_frame(
            (
                {"impact_id": impact.impact_id, "start_time": impact.start_time, **impact.setup},
                impact.evaluation,
            )
            for impact in self.impacts
        )

    def _unprotected(self) -> Iterator[str]:
        """What in this file could have changed without being noticed."""
        if not self._source.checked:
            yield "no checksum covers the index of this file: damage to it may stay unnoticed"
        if RECOVERED in self._indexed:
            lost = self._source.metadata(self._indexed[RECOVERED]).get("lost", "")
            yield f"recovered from a damaged or unfinished log; lost: {lost}"
        if self._source.format == 1 and RUN in self._indexed:
            yield (
                "log format 1: no checksum covers run, setups and start times; a setup is compared "
                "with that of the samples when they are read"
            )

    def _refuse_newer(self) -> None:
        version = self._source.format  # first: a later one may seal its metadata otherwise
        if version <= FORMAT_VERSION:
            text = self.run.get("format", "1")
            if not (text.isdecimal() and text.isascii() and len(text) < 7):
                raise LogError(f"{self.path}: log format {text!r} is not a number")
            version = int(text)
        if version > FORMAT_VERSION:
            raise LogError(
                f"{self.path}: log format {version}; this program reads up to {FORMAT_VERSION}, "
                "a later one is needed"
            )


def open_log(path: str | Path) -> ImpactLog:
    """Open a log of the recorder, or a bag in MCAP form that holds ``impact/samples``.

    Raises:
        LogError: no such file, not an MCAP file, unfinished, of a later format, with mixed clocks,
            or without samples of impacts.
    """
    return ImpactLog(path)


def read_impacts(path: str | Path) -> Iterator[LoggedImpact]:
    """Every complete impact of a log, in order.

    Raises:
        LogError: as :func:`open_log`.
    """
    return iter(open_log(path))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:12]
