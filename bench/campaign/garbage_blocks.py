"""Garbage and forged blocks among those of an impact, and forged criteria."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from bench.campaign.attack import Attack, Outcome
from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.biomech.record import block_labels, same_samples, to_block
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import HelmetSimError, IncompleteError
from helmet_sim_ros.mcap_log.blocks import Assembled, Assembler, Block, parse_block
from helmet_sim_ros.mcap_log.criteria import evaluation_of

ROWS = 10
ODD: list[Any] = [
    None, True, -1, 0, 1, 2**31, 2**63, 10**30, 1.5, 1e308, "", "x", "1", [], [1], {}, {"a": 1},
    float("nan"), float("inf"), -0.0, "\x00", "\ud800", "a" * 300, "../x", "<b>", [[1, 2], [3]],
    [1.0, "x"], [[1.0], 2.0], [1e400, {}], {"notes": None},
]  # fmt: skip
HEADERS = ["", "null", "[]", "{}", "[" * 5000, '{"a":' * 3000, "1" * 5000, "\x00", '{"first": 0}',
           '{"impact_id": "x", "impact_id": "y"}', "NaN", '"text"']  # fmt: skip


class GarbageBlocks(Attack):
    """An impact is complete with its own samples, or incomplete; criteria are read, or refused."""

    name = "garbage blocks"
    what = "blocks and criteria changed, dropped, doubled, of other impacts and of no impact"
    cases = (2000, 20_000)

    def prepare(self, folder: Path) -> None:
        self._true = simulate(ImpactSetup(duration=0.002, time_step=1e-4, rig="headform"))
        labels = tuple(block_labels(self._true.joint_names))
        data = to_block(self._true)
        self._blocks = [
            Block(
                "true", first, len(data), 1.0, labels, data[first : first + ROWS],
                setup=dict(self._true.setup) if first == 0 else None,
                extras={"notes": ["one"]} if first + ROWS >= len(data) else None,
            )
            for first in range(0, len(data), ROWS)
        ]  # fmt: skip
        self._verdict = evaluate(self._true)

    def case(self, rng: random.Random) -> Outcome:
        return self._criteria(rng) if rng.random() < 0.2 else self._assembly(rng)

    def _assembly(self, rng: random.Random) -> Outcome:
        assembler, ended, refused = Assembler(), list[Assembled](), 0
        for header, labels, data in self._sent(rng):
            try:
                ended += assembler.feed(parse_block(header, labels, data))
            except IncompleteError:
                refused += 1
        ended += assembler.abandon("the end")
        whole = 0
        for impact in ended:
            if (impact.record is None) != bool(impact.problem):
                return Outcome("lost", f"neither complete nor explained: {impact}")
            if impact.impact_id == "true" and impact.record is not None:
                whole += 1
                if not same_samples(impact.record, self._true):
                    return Outcome("lost", "other samples under the name of the impact")
                if impact.record.setup != self._true.setup:
                    return Outcome("lost", "another setup under the name of the impact")
                evaluate(impact.record)
        return Outcome("held" if whole and not refused else "refused", f"{whole} whole")

    def _sent(self, rng: random.Random) -> Iterator[tuple[Any, Any, Any]]:
        """The impact's blocks as they arrive, some of them changed or strange."""
        changed = rng.randrange(len(self._blocks)) if rng.random() < 0.8 else -1
        for number, block in enumerate(self._blocks):
            header, labels = json.loads(block.header()), ",".join(block.labels)
            data: Any = block.data.ravel()
            if number == changed:
                how = rng.randrange(9)
                if how == 0:
                    continue
                if how == 1:
                    yield json.dumps(header), labels, data
                elif how == 2:
                    yield rng.choice(HEADERS), labels, data
                elif how == 3:  # another impact, of any kind
                    other = header | {"impact_id": rng.choice(["other", *ODD])}
                    yield json.dumps(other), labels, data
                elif how == 4:
                    key = rng.choice([*header, "aborted", "model", "extras", "setup", "x", "data"])
                    # The impact's own setup and samples cannot be told from forged ones.
                    forged = key == "setup" and isinstance(header.get(key), dict)
                    value = rng.choice(ODD)
                    if not (forged and isinstance(value, dict | None)):
                        header[key] = value
                elif how == 5:
                    labels = rng.choice(["", ",", "time", labels[:-1], labels + ",time", "\x00"])
                elif how == 6:
                    data = data[: rng.randrange(len(data))]
                elif how == 7:
                    data = rng.choice([None, "x", ["x"], [[1.0], 2.0], [None], np.zeros((2, 2))])
                else:
                    header["aborted"] = "forged"
            yield json.dumps(header), labels, data

    def _criteria(self, rng: random.Random) -> Outcome:
        data = self._verdict.as_dict()
        name = rng.choice(list(data["criteria"]))
        entry = data["criteria"][name]
        target = rng.choice([data, data["criteria"], entry])
        target[rng.choice([*target, "x"])] = rng.choice(ODD)
        text = json.dumps(data)
        if rng.random() < 0.2:
            at = rng.randrange(len(text))
            text = rng.choice([text[:at], text[:at] + "[" * 3000, rng.choice(HEADERS)])
        try:
            found = Evaluation.from_json(text)
            found.to_json()
            evaluation_of(_array(found, rng))
        except HelmetSimError as error:
            return Outcome("refused", str(error))
        return Outcome("held")


def _array(evaluation: Evaluation, rng: random.Random) -> Any:
    """A message of criteria with one value that does not belong there."""
    status = []
    for criterion in evaluation.criteria.values():
        pairs = {"value": json.dumps(criterion.value), "unit": criterion.unit, "verdict": "info"}
        if rng.random() < 0.1:
            pairs[rng.choice([*pairs, "t1", "t2", "evaluation.title", "x"])] = rng.choice(
                [*HEADERS, "1", "NaN", "info"]
            )
        values = [SimpleNamespace(key=key, value=value) for key, value in pairs.items()]
        status.append(
            SimpleNamespace(name=criterion.name, hardware_id="a", message="", values=values)
        )
    whole = {"evaluation.standard": "x", "evaluation.title": "x", "evaluation.messages": "[]",
             "evaluation.warnings": "[]"}  # fmt: skip
    if status:
        status[0].values += [SimpleNamespace(key=k, value=v) for k, v in whole.items()]
    return SimpleNamespace(status=status)
