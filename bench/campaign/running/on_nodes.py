"""What the attacks on running nodes have in common: nodes, random impacts, and what must be so."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, ClassVar

from bench.campaign.attack import Attack, Outcome
from bench.campaign.running import Rig
from helmet_sim_ros import ImpactSetup, evaluate, open_log, simulate
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import LoggedImpact
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.mcap_log.layout import NO_CRITERIA
from helmet_sim_ros.mcap_log.recover import recover
from helmet_sim_ros.mcap_log.writer import PART
from helmet_sim_ros.nodes.setup_parameters import parameter_values

#: How long the middleware may take to forget a killed process, on a machine that is busy [s];
#: Fast DDS does so after 20 s.
FORGOTTEN = 120.0
#: How long a node may take to start, if it has to compile [s].
STARTED = 300.0
#: How long an answer may take: a hanging reader is waited for 30 s, several times at most [s].
ANSWERED = 200.0
#: How long a recorder may take to tell what became of an impact [s].
TOLD = 60.0


class Loss(Exception):
    """Something is gone, doubled, mixed or changed, and nobody was told."""


class OnNodes(Attack):
    """An attack on nodes that run through all its cases, each a process of its own.

    After a case that raised, the next one begins with new nodes.

    Attributes:
        kinds: the nodes.
        parameters: of the recorder.
    """

    bounded = False
    kinds: ClassVar[tuple[str, ...]] = ("simulation", "evaluator", "recorder")
    parameters: ClassVar[dict[str, Any]] = {}
    _rig: Rig | None = None

    def prepare(self, folder: Path) -> None:
        self._folder, self._runs = folder, 0

    def case(self, rng: random.Random) -> Outcome:
        if self._rig is None:
            self._rig = self._begun()
        try:
            return self.attacked(self._rig, rng)
        except Loss as loss:
            self._end()
            return Outcome("lost", str(loss))
        except BaseException:
            self._end()
            raise

    @abstractmethod
    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        """One case. May raise :class:`Loss`."""

    def close(self) -> None:
        self._end()

    def place(self, home: Path) -> Path:
        """Where the logs of nodes go that have this folder."""
        return home / "logs"

    def _end(self) -> None:
        rig, self._rig = self._rig, None
        if rig is not None:
            rig.__exit__(Loss, None, None)  # exit codes are not what is looked at here

    def _begun(self) -> Rig:
        self._runs += 1
        self.home = self._folder / f"run_{self._runs}"
        self.home.mkdir()
        self.logs = self.place(self.home)
        self.logs.mkdir()
        rig = Rig(self.home).__enter__()
        try:
            for kind in self.kinds:
                self.start(rig, kind)
            self.connected(rig)
        except BaseException:
            rig.__exit__(Loss, None, None)
            raise
        return rig

    def start(self, rig: Rig, kind: str) -> None:
        """Start a node, and wait until it tells its status or answers."""
        rig.status.pop(kind, None)
        values = {"output_dir": self.logs} | self.parameters if kind == "recorder" else {}
        rig.start(kind, **values)
        if kind != "evaluator":
            rig.until(lambda: kind in rig.status, STARTED)

    def connected(self, rig: Rig) -> None:
        """Wait until the simulation has exactly its two readers."""
        rig.until(lambda: rig.status["simulation"].get("readers") == "2", FORGOTTEN)

    def finished(self, rig: Rig) -> dict[str, LoggedImpact]:
        """End the log; every impact in it and in those before."""
        answer = waited(rig, rig.ask("recorder/finish"))
        if not answer.success and "no log is open" not in answer.message:
            raise Loss(f"the log was not finished: {answer.message}")
        return logged(self.logs)

    def cleared(self) -> None:
        """Remove the logs of a case."""
        for path in self.logs.iterdir():
            path.unlink()

    def goes_on(self, rig: Rig, rng: random.Random) -> None:
        """After a case in which logs were lost: the next impact is in the next log."""
        self.cleared()
        again = run_setups(rig, random_setups(rng, 1))
        compare_all(self.finished(rig), again)
        self.cleared()


def random_setup(rng: random.Random) -> ImpactSetup:
    """A short impact of any kind."""
    return ImpactSetup(
        rig=rng.choice(["headform", "headform", "rider"]),
        direction=rng.choice(["front", "back", "left", "right", "top"]),
        normal_velocity=rng.uniform(2.0, 8.0),
        tangential_velocity=rng.uniform(0.0, 10.0),
        friction=rng.uniform(0.1, 0.8),
        duration=rng.choice([1e-3, 3e-3, 1e-2]),
        time_step=1e-4,
    )


def waited(rig: Rig, future: Any, seconds: float = ANSWERED) -> Any:
    """The answer to a call."""
    rig.until(future.done, seconds)
    return future.result()


def run_setup(
    rig: Rig, setup: ImpactSetup, meanwhile: Callable[[], object] = lambda: None
) -> dict[str, Any]:
    """Have a setup run, and something be done meanwhile; its answer. Nobody waits for criteria."""
    reason = rig.set(**parameter_values(setup))
    if reason:
        raise Loss(f"a good setup was refused: {reason}")
    call = rig.ask("simulation/run_impact")
    meanwhile()
    answer = waited(rig, call)
    if not answer.success:
        raise Loss(f"an impact failed: {answer.message}")
    result: dict[str, Any] = json.loads(answer.message)
    if result["setup_digest"] != setup_digest(setup.described()):
        raise Loss(f"{result['impact_id']} ran with another setup")
    return result


def run_setups(rig: Rig, setups: Iterable[ImpactSetup]) -> dict[str, ImpactSetup]:
    """The same for many; impact id -> setup."""
    ran = {}
    for setup in setups:
        impact_id = run_setup(rig, setup)["impact_id"]
        if impact_id in ran:
            raise Loss(f"two impacts are called {impact_id}")
        ran[impact_id] = setup
    return ran


def halt(rig: Rig, process: subprocess.Popen[bytes], seconds: float) -> None:
    """Have a process stand still for a while."""
    process.send_signal(signal.SIGSTOP)
    try:
        rig.serve(seconds)
    finally:
        process.send_signal(signal.SIGCONT)


def recorded(rig: Rig, setups: Iterable[ImpactSetup]) -> tuple[dict[str, ImpactSetup], set[str]]:
    """Have setups run: impact id -> setup, and which were told as on disk, not as an error."""
    ran, told = {}, set()
    for setup in setups:
        impact_id, on_disk = _recorded(rig, setup)
        ran[impact_id] = setup
        told |= {impact_id} if on_disk else set()
    return ran, told


def _recorded(rig: Rig, setup: ImpactSetup) -> tuple[str, bool]:
    rig.status["recorder"] = {"impact_id": "", "level": "", "message": ""}
    impact_id = run_setup(rig, setup)["impact_id"]

    def told() -> bool:
        status = rig.status["recorder"]
        return status["impact_id"] == impact_id or status["level"] == "error"

    if not served_until(rig, told, TOLD):
        raise Loss(f"{impact_id}: nobody told whether it is on disk")
    return impact_id, rig.status["recorder"]["level"] != "error"


def logged(folder: Path) -> dict[str, LoggedImpact]:
    """Every impact in the logs of a folder, after recovery of those that were not finished."""
    found: dict[str, LoggedImpact] = {}
    for part in folder.glob("*" + PART):
        if part.with_suffix("").exists():
            continue
        try:
            recover(part)
        except LogError:  # nothing complete in it: whether anything was told is compared later
            continue
    for path in sorted(folder.glob("*.mcap")):
        for impact in open_log(path).impacts:
            if impact.impact_id in found:
                raise Loss(f"{impact.impact_id} is in the logs twice")
            found[impact.impact_id] = impact
    return found


def compare(impact: LoggedImpact, setup: ImpactSetup, judged: bool = True) -> None:
    """Hold a logged impact against the same one computed in this process.

    Args:
        judged: its criteria must be there as well.

    Raises:
        Loss: they differ in a bit.
        LogError: what was logged instead of criteria, in words.
    """
    record, name = simulate(setup), impact.impact_id
    if dict(impact.setup) != dict(record.setup):
        raise Loss(f"{name}: the log has another setup")
    if not same_samples(impact.record, record):
        raise Loss(f"{name}: the log has other samples")
    found = impact.logged
    if found is None and judged:
        source = impact._log._source
        notes = [i for i in source.metadata_index if i.name == NO_CRITERIA + name]
        told = "; ".join(source.metadata(note)["reason"] for note in notes)
        raise Loss(f"{name}: no criteria in the log: {told or 'and it does not say why'}")
    if found is not None and found != evaluate(record):
        raise Loss(f"{name}: the log has other criteria")


def compare_told(
    found: dict[str, LoggedImpact], ran: dict[str, ImpactSetup], told: set[str]
) -> None:
    """What was told as on disk is there, with its criteria; what is there is what ran."""
    if gone := told - set(found):
        raise Loss(f"told as on disk, but not there: {sorted(gone)}")
    for impact_id in set(found) & set(ran):
        compare(found[impact_id], ran[impact_id], judged=impact_id in told)


def compare_all(
    found: dict[str, LoggedImpact], ran: dict[str, ImpactSetup], judged: bool = True
) -> None:
    """The same for every impact that ran; none may be missing."""
    missing = sorted(set(ran) - set(found))
    if missing:
        raise Loss(f"{len(missing)} of {len(ran)} impacts are not in the log: {missing[:5]}")
    for impact_id, setup in ran.items():
        compare(found[impact_id], setup, judged)


def served_until(rig: Rig, ready: Callable[[], Any], seconds: float) -> bool:
    """Serve callbacks until something is so, or the time is up; whether it is so."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if ready():
            return True
        rig.serve(0.01)
    return bool(ready())


def random_setups(rng: random.Random, count: int) -> Sequence[ImpactSetup]:
    """Several :func:`random_setup`."""
    return [random_setup(rng) for _ in range(count)]
