"""Properties of what reads foreign data: files, parameters, blocks, results."""

from __future__ import annotations

import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from helmet_sim_ros import ImpactSetup, evaluate, open_log, simulate
from helmet_sim_ros.biomech.record import (
    FloatArray,
    ImpactRecord,
    block_labels,
    same_samples,
    to_block,
)
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import HelmetSimError, IncompleteError, LogError, SetupError, printable
from helmet_sim_ros.mcap_log.blocks import Assembler, Block, parse_block
from helmet_sim_ros.mcap_log.records import MAGIC
from helmet_sim_ros.mcap_log.recover import recover
from helmet_sim_ros.mcap_log.seal import sealed, unsealed
from helmet_sim_ros.model.rider.properties import Rider
from helmet_sim_ros.model.setup import setup_from_names, setup_leaves
from helmet_sim_ros.schema import Leaf
from helmet_sim_ros.yaml_file import parse_yaml

#: Bounded and the same in every run.
BOUNDED = settings(
    max_examples=80, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
scalars = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), texts,
)  # fmt: skip
trees = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
    max_leaves=12,
)
SAMPLES = 21


@cache
def recorded() -> ImpactRecord:
    """A short impact; at the first test that needs it, so that no process that only collects tests
    waits for machine code."""
    return simulate(ImpactSetup(duration=0.002, time_step=1e-4, rig="headform"))


@cache
def judged() -> Evaluation:
    """Its criteria."""
    return evaluate(recorded())


@cache
def labels() -> tuple[str, ...]:
    """Of the columns of its samples."""
    return tuple(block_labels(recorded().joint_names))


@cache
def samples() -> FloatArray:
    """Its samples as one array."""
    return to_block(recorded())


# YAML


@given(trees)
@BOUNDED
def test_what_yaml_writes_reads_back(tree) -> None:
    assert parse_yaml(yaml.safe_dump(tree, allow_unicode=True)) == tree


@given(st.text(st.sampled_from("[]{}:,-&*!|>'\"%#?\n \tab1.e+~<"), max_size=60))
@BOUNDED
def test_any_text_is_plain_data_or_refused(text) -> None:
    try:
        found = parse_yaml(text)
    except yaml.YAMLError as error:
        assert "\n" not in str(error)
        return
    assert json.loads(json.dumps(found)) == found or found != found


# parameters


def within(leaf: Leaf) -> st.SearchStrategy:
    if leaf.choices:
        return st.sampled_from(leaf.choices)
    low, high = leaf.minimum, leaf.maximum
    return st.floats(low, high, exclude_min=leaf.exclusive_minimum)


#: Where a headform is struck; a rider is placed otherwise.
PLACED = ("impact.azimuth_deg", "impact.elevation_deg")
#: Numbers and choices, without those that depend on others.
LEAVES = {
    leaf.name: leaf
    for leaf in setup_leaves()
    if (leaf.choices or (leaf.type is float and leaf.maximum is not None))
    and not leaf.name.startswith(("sim.", *PLACED))
}
sets = st.lists(st.sampled_from(sorted(LEAVES)), min_size=1, max_size=6, unique=True).flatmap(
    lambda names: st.fixed_dictionaries({name: within(LEAVES[name]) for name in names})
)


@given(sets)
@BOUNDED
def test_every_value_within_its_range_is_taken_as_it_is(values) -> None:
    described = setup_from_names(values).described()
    for name, value in values.items():
        assert described[name] == ("left" if value == "side" else value)
    again = setup_from_names({k: v for k, v in described.items() if k != "helmet.description"})
    assert again.described() == described


@given(st.sampled_from(sorted(LEAVES)), trees)
@BOUNDED
def test_any_other_value_is_refused_by_name_and_range(name, value) -> None:
    try:
        taken = setup_from_names({name: value}).described()[name]
    except SetupError as error:
        assert name in str(error) and str(error).isprintable()
        assert error.problems and all(problem.allowed for problem in error.problems)
        return
    assert taken == value or value is None


@given(st.text(max_size=30))
@BOUNDED
def test_a_message_is_always_printable_and_keeps_what_is(text) -> None:
    shown = printable(text)
    assert shown.replace("\n", "").isprintable()
    shown.encode()
    if text.isprintable():
        assert shown == text
    assert str(SetupError.of(text, text, "must not be")).replace("\n", "").isprintable()


def test_a_setup_shows_itself_by_what_differs_from_the_defaults() -> None:
    assert repr(ImpactSetup()) == "ImpactSetup()" and repr(Rider()) == "Rider()"
    assert repr(Rider(mass=80.0)) == "Rider(mass=80.0)"


# blocks


@given(st.lists(st.integers(1, SAMPLES - 1), max_size=6, unique=True))
@BOUNDED
def test_however_the_samples_are_cut_they_come_together_bit_for_bit(cuts) -> None:
    edges = [0, *sorted(cuts), SAMPLES]
    assembler, ended = Assembler(), []
    for begin, end in pairwise(edges):
        block = Block("a", begin, SAMPLES, 1.0, labels(), samples()[begin:end])
        ended += assembler.feed(
            parse_block(block.header(), ",".join(labels()), block.data.ravel().tolist())
        )
    (impact,) = ended
    assert impact.record is not None and same_samples(impact.record, recorded())


@given(st.lists(st.integers(0, 5), min_size=1, max_size=12))
@BOUNDED
def test_impacts_that_mix_give_only_what_was_sent(order) -> None:
    """Two impacts of three blocks each, in any order, with repetitions."""
    blocks = [
        Block(name, i, SAMPLES, 1.0, labels(), factor * samples()[i : i + 7])
        for name, factor in (("a", 1.0), ("b", 1.0 + 2**-30))
        for i in (0, 7, 14)
    ]
    assembler = Assembler()
    ended = [impact for k in order for impact in assembler.feed(blocks[k])]
    ended += assembler.abandon("the end")
    for impact in ended:
        assert (impact.record is None) == bool(impact.problem)
        if impact.record is not None:
            factor = 1.0 if impact.impact_id == "a" else 1.0 + 2**-30
            assert np.array_equal(to_block(impact.record), factor * samples())
    complete = sum(impact.record is not None for impact in ended)
    text = "".join(map(str, order))
    assert complete <= text.count("012") + text.count("345")


@given(trees, st.one_of(texts, trees), trees)
@BOUNDED
def test_any_data_is_a_block_or_refused(header, labels, data) -> None:
    try:
        parse_block(json.dumps(header), labels, data)
    except IncompleteError as error:
        assert "not a block of samples" in str(error)


# results


@given(st.data())
@BOUNDED
def test_a_result_with_any_other_value_is_read_or_refused(data) -> None:
    good = judged().as_dict()
    assert Evaluation.from_dict(good) == judged()
    name = data.draw(st.sampled_from(sorted(good["criteria"])))
    target = data.draw(st.sampled_from(["whole", "criteria", "criterion"]))
    place = {"whole": good, "criteria": good["criteria"], "criterion": good["criteria"][name]}
    place[target][data.draw(st.sampled_from(sorted(place[target])))] = data.draw(trees)
    try:
        found = Evaluation.from_json(json.dumps(good))
    except HelmetSimError:
        return
    assert Evaluation.from_json(found.to_json()) == found


# files


@given(st.dictionaries(texts, texts, max_size=5), texts, st.integers(0, 10), texts)
@BOUNDED
def test_a_seal_fits_its_record_alone(values, name, which, other) -> None:
    values.pop("sha256", None)
    good = sealed(name, values)
    assert unsealed(name, good) == values
    keys = sorted(good)
    key = keys[which % len(keys)]
    assume(good[key] != other)
    try:
        unsealed(name, good | {key: other})
    except ValueError:
        return
    raise AssertionError("a changed record passed for a sealed one")


@given(st.binary(max_size=400), st.booleans())
@BOUNDED
def test_any_bytes_are_refused_as_a_log(tmp_path: Path, content, ends) -> None:
    path = tmp_path / "any.mcap"
    path.write_bytes(MAGIC + content + (MAGIC if ends else b""))
    for action in (open_log, recover):
        try:
            action(path)
        except LogError as error:
            assert str(path) in str(error)
            continue
        raise AssertionError("noise is no log")
