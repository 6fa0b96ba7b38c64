"""The search for designs: Optuna proposes, the engine simulates, SQLite remembers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from helmet_sim_ros.errors import SetupError, StudyError
from helmet_sim_ros.extra import need
from helmet_sim_ros.study.helmets.files import values_beside
from helmet_sim_ros.study.optimisation.output import plot_trials, write_sensitivity, write_trials
from helmet_sim_ros.study.optimisation.plan import Optimisation, load_optimisation
from helmet_sim_ros.study.optimisation.sensitivity import sensitivity
from helmet_sim_ros.study.optimisation.trials import (
    OptimisationResult,
    Trial,
    best,
    evaluate_designs,
)
from helmet_sim_ros.study.sweeps.engine import Engine, open_engine
from helmet_sim_ros.study.sweeps.folder import StudyFolder
from helmet_sim_ros.study.sweeps.sweep import Progress

#: Optuna's own tables of a study.
DATABASE = "optuna.db"


def optimise(
    plan: Optimisation | str | Path,
    output: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    trials: int | None = None,
) -> OptimisationResult:
    """Search for the best designs, or go on with a search in the same folder.

    An interrupted search goes on as if it had not been, whatever the number of workers: Optuna's
    sampler is seeded per batch and sees whole batches only.

    Args:
        plan: an optimisation, its name in ``config/studies``, or the path of a YAML file.
        output: results folder; unset: ``NAME.optimisation`` in the working directory.
        workers, scheduler, progress: as for :func:`~helmet_sim_ros.study.sweep`.
        trials: designs in all; unset: as the file says.

    Raises:
        SetupError: a bad file, foreign results in the folder, or no such scheduler; before the
            first impact.
        StudyError: stopped on the way; finished designs are kept, and the same call goes on.
    """
    plan = plan if isinstance(plan, Optimisation) else load_optimisation(plan)
    path = Path(f"{plan.name}.optimisation" if output is None else output)
    note = {"optimisation": plan.name, "file": plan.file.model_dump()}
    with StudyFolder(path, plan.identity, note) as folder:
        search = _Search(plan, folder)
        with open_engine(workers, scheduler) as engine:
            reference = next(evaluate_designs(plan, engine, [(-1, {}, plan.design({}))]))
            computed = search.run(engine, trials or plan.file.trials, progress)
            found = search.trials()
            chosen = best(plan, found)
            effects = sensitivity(plan, engine, chosen[0]) if chosen else ()
        result = OptimisationResult(plan, path, reference, found, chosen, tuple(effects), computed)
        _write_helmets(folder, result)
        folder.write(path / "trials.csv", lambda to: write_trials(to, result))
        folder.write(path / "sensitivity.csv", lambda to: write_sensitivity(to, effects))
        folder.write(path / "pareto.png", lambda to: plot_trials(to, result))
    return result


class _Search:
    """An Optuna study in a folder.

    Optuna works in memory; a trial goes to the database once it is finished, in one transaction.
    """

    def __init__(self, plan: Optimisation, folder: StudyFolder) -> None:
        self._optuna = need("optuna", "study")
        self._plan = plan
        self._optuna.logging.set_verbosity(self._optuna.logging.ERROR)
        self._directions = ["minimize" if g.minimise else "maximize" for g in plan.file.objectives]
        self._place = folder.path / DATABASE
        try:
            self._kept = self._optuna.create_study(
                storage=f"sqlite:///{self._place.resolve()}", study_name=plan.name,
                directions=self._directions, load_if_exists=True,
            )  # fmt: skip
            self._stored = list(self._kept.get_trials(deepcopy=False))
        except Exception as error:  # SQLAlchemy's, and Optuna's own
            raise SetupError.of("output", str(self._place), f"cannot be used: {error}") from None

    def run(self, engine: Engine, wanted: int, progress: Progress | None) -> int:
        """Search until ``wanted`` trials are there; the number of those computed now."""
        batch, computed = self._plan.file.batch, 0
        memory = self._optuna.create_study(directions=self._directions)
        whole = len(self._stored) // batch * batch
        memory.add_trials(self._stored[:whole])
        while len(self._stored) < wanted:
            _tell(progress, self.trials(), wanted)
            memory.sampler = self._sampler(len(memory.trials) // batch)
            asked = [memory.ask(self._distributions()) for _ in range(batch)]
            # What a killed process had stored of this batch is proposed again, and known already.
            new = {trial.number: trial for trial in asked[len(self._stored) % batch :]}
            found = {trial.number: trial for trial in self._evaluated(engine, new)}
            for trial in asked:
                known = found.get(trial.number)
                self._report(memory, trial, known or _trial(self._stored[trial.number]))
                if known is not None:
                    self._keep(memory.get_trials(deepcopy=False)[trial.number])
            computed += len(found)
        _tell(progress, self.trials(), wanted)
        return computed

    def trials(self) -> tuple[Trial, ...]:
        """Every finished trial."""
        return tuple(_trial(frozen) for frozen in self._stored)

    def _distributions(self) -> dict[str, Any]:
        kind = self._optuna.distributions.FloatDistribution
        return {name: kind(*bounds) for name, bounds in self._plan.file.variables.items()}

    def _evaluated(self, engine: Engine, asked: Mapping[int, Any]) -> Iterator[Trial]:
        designs = []
        for number, trial in asked.items():
            try:
                designs.append((number, trial.params, self._plan.design(trial.params)))
            except SetupError as error:  # a combination that makes no helmet
                yield Trial(number, dict(trial.params), error=str(error))
        yield from evaluate_designs(self._plan, engine, designs)

    def _report(self, memory: Any, trial: Any, found: Trial) -> None:
        """Tell Optuna what became of a trial."""
        trial.set_user_attr("responses", json.dumps(found.responses))
        trial.set_user_attr("excess", json.dumps(found.excess))
        if found.error is not None:
            trial.set_user_attr("error", found.error)
            memory.tell(trial, state=self._optuna.trial.TrialState.FAIL)
            return
        for name, value in found.excess.items():
            trial.set_constraint(name, value)
        memory.tell(trial, [found.responses[g.response] for g in self._plan.file.objectives])

    def _keep(self, frozen: Any) -> None:
        try:
            self._kept.add_trial(frozen)
        except Exception as error:  # SQLAlchemy's, and Optuna's own
            raise StudyError(
                f"{self._place}: cannot be written: {error}; every design finished so far is kept, "
                "the same command goes on from there"
            ) from None
        self._stored.append(frozen)

    def _sampler(self, batch: int) -> Any:
        """A fresh sampler per batch: nothing but the stored trials decides what it proposes."""
        samplers, seed = self._optuna.samplers, self._plan.file.seed + batch
        if self._plan.file.sampler == "nsga2":
            return samplers.NSGAIISampler(population_size=self._plan.file.batch, seed=seed)
        if self._plan.file.sampler == "random":
            return samplers.RandomSampler(seed=seed)
        return samplers.TPESampler(
            n_startup_trials=self._plan.file.batch, multivariate=True, seed=seed
        )


def _trial(frozen: Any) -> Trial:
    attributes = frozen.user_attrs
    return Trial(
        frozen.number, dict(frozen.params), json.loads(attributes["responses"]),
        json.loads(attributes["excess"]), attributes.get("error"),
    )  # fmt: skip


def _write_helmets(folder: StudyFolder, result: OptimisationResult) -> None:
    """The best designs as helmet files, and no others."""
    plan = result.plan
    for trial in result.best:
        told = ", ".join(f"{name} {value:.4g}" for name, value in trial.responses.items())
        about = {"description": f"Design {trial.number} of the optimisation {plan.name}: {told}."}
        path = result.helmet_file(trial)
        path.parent.mkdir(parents=True, exist_ok=True)
        helmet = values_beside(plan.design(trial.values).helmet, path.parent)
        text = yaml.safe_dump(_plain(helmet | about), sort_keys=False)
        folder.write(path, partial(_write_text, text))
    kept = {result.helmet_file(trial) for trial in result.best}
    for path in (folder.path / "designs").glob("design_*.yaml"):
        if path not in kept:
            path.unlink()


def _write_text(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items() if v is not None}
    return list(value) if isinstance(value, tuple) else value


def _tell(progress: Progress | None, trials: Sequence[Trial], wanted: int) -> None:
    if progress is not None:
        progress(len(trials), wanted, sum(trial.error is not None for trial in trials))
