"""Sample blocks: only a complete impact in order becomes a record."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helmet_sim_ros.biomech.record import block_labels, from_block, same_samples
from helmet_sim_ros.errors import IncompleteError, PulseError
from helmet_sim_ros.mcap_log.blocks import Assembler, Block, parse_block
from helmet_sim_ros.mcap_log.digest import setup_digest

LABELS = tuple(block_labels(("knee",)))
DATA = np.random.default_rng(1).normal(size=(40, len(LABELS)))
DATA[:, 0] = np.arange(40) * 1e-4
SIZES = (7, 1, 12, 20)


def blocks(impact_id: str = "a-1", start_time: float = 1.0) -> list[Block]:
    edges = np.cumsum([0, *SIZES])
    return [
        Block(impact_id, int(i), 40, start_time, LABELS, DATA[i:j], {"k": 1} if i == 0 else None)
        for i, j in pairwise(edges)
    ]


def travelled(block: Block) -> Block:
    return parse_block(block.header(), ",".join(block.labels), block.data.ravel())


def test_a_block_survives_its_journey_bit_for_bit() -> None:
    for block in blocks():
        arrived = travelled(block)
        assert np.array_equal(arrived.data, block.data)
        assert replace(arrived, data=block.data) == block


def test_blocks_in_order_become_the_record() -> None:
    assembler = Assembler()
    ended = [impact for block in blocks() for impact in assembler.feed(travelled(block))]
    (impact,) = ended
    assert impact.record is not None and not impact.problem and assembler.pending is None
    assert same_samples(impact.record, from_block(list(LABELS), DATA))
    assert impact.record.setup == {"k": 1}


@given(st.lists(st.integers(0, len(SIZES) - 1), max_size=8))
def test_any_other_order_never_gives_a_record_that_was_not_sent(order: list[int]) -> None:
    sent, assembler = blocks(), Assembler()
    ended = [impact for i in order for impact in assembler.feed(sent[i])]
    complete = [impact for impact in ended if impact.record is not None]
    whole = "".join(map(str, order)).count("0123")
    assert len(complete) <= whole
    if order == [0, 1, 2, 3]:
        assert len(complete) == 1
    for impact in complete:
        assert impact.record is not None
        assert same_samples(impact.record, from_block(list(LABELS), DATA))
    for impact in ended:
        assert (impact.record is None) == impact.problem.startswith("incomplete")


def test_an_impact_that_another_one_follows_is_incomplete() -> None:
    assembler = Assembler()
    for block in blocks("a-1")[:2]:
        assert assembler.feed(block) == []
    ended = [impact for block in blocks("a-2") for impact in assembler.feed(block)]
    assert [impact.impact_id for impact in ended] == ["a-1", "a-2"]
    assert "followed by impact a-2 (impact a-1, 8 of 40)" in ended[0].problem
    assert ended[1].record is not None


def test_an_aborted_impact_says_why() -> None:
    assembler = Assembler()
    assembler.feed(blocks()[0])
    end = replace(blocks()[1], data=DATA[:0], aborted="it diverged")
    (impact,) = assembler.feed(travelled(end))
    assert impact.problem == "incomplete: it diverged (impact a-1, 7 of 40)"
    assert assembler.feed(blocks()[2]) == []  # told once


def test_an_impact_whose_sender_is_gone_is_given_up_and_said_to_be() -> None:
    assembler = Assembler()
    assert assembler.abandon("the simulation is gone") == []  # none was under way
    for block in blocks()[:2]:
        assembler.feed(block)
    (impact,) = assembler.abandon("the simulation is gone")
    assert impact.problem == "incomplete: the simulation is gone (impact a-1, 8 of 40)"
    assert impact.record is None and assembler.pending is None
    assert assembler.abandon("the simulation is gone") == []  # told once


def test_samples_that_are_not_uniform_in_time_are_refused() -> None:
    data = DATA.copy()
    data[20, 0] += 5e-5
    assembler = Assembler()
    (impact,) = assembler.feed(Block("a-1", 0, 40, 1.0, LABELS, data))
    assert impact.record is None and "uniform" in impact.problem


def test_channels_must_stay_the_same() -> None:
    first, second, *_ = blocks()
    for change in ({"total": 41}, {"labels": LABELS[::-1]}, {"uniform": False}):
        assembler = Assembler()
        assembler.feed(first)
        (impact,) = assembler.feed(replace(second, **change))
        assert "changed on the way" in impact.problem


@pytest.mark.parametrize(
    ("header", "labels", "data"),
    [
        ("", "time", [0.0]),
        ("[1]", "time", [0.0]),
        ('{"impact_id": "a"}', "time", [0.0]),
        (json.dumps({"impact_id": "a", "first": 0, "total": 2, "start_time": 1.0}), "time,x", [0]),
        (json.dumps({"impact_id": "a", "first": 2, "total": 2, "start_time": 1.0}), "time", [0]),
        (json.dumps({"impact_id": "a", "first": -1, "total": 2, "start_time": 1.0}), "time", [0]),
        (json.dumps({"impact_id": "a", "first": 0.5, "total": 2, "start_time": 1.0}), "time", [0]),
        (json.dumps({"impact_id": 1, "first": 0, "total": 2, "start_time": 1.0}), "time", [0]),
        (json.dumps({"impact_id": "a", "first": 0, "total": 2, "start_time": "x"}), "time", [0]),
        (json.dumps({"impact_id": "a", "first": 0, "total": 2, "start_time": 1, "z": 1}), "t", [0]),
    ],
)
def test_what_is_no_block_is_refused(header: str, labels: str, data: list[float]) -> None:
    with pytest.raises(IncompleteError, match="not a block of samples"):
        parse_block(header, labels, data)


def test_extras_arrive_without_a_setup_and_a_setup_without_extras() -> None:
    sent = [replace(block, setup=None) for block in blocks()]
    sent[-1] = replace(sent[-1], extras={"notes": ["hand first"], "crush": [0.5, 0.25]})
    assembler = Assembler()
    (impact,) = [impact for block in sent for impact in assembler.feed(travelled(block))]
    assert impact.record is not None and impact.record.setup == {}
    assert impact.record.extras["notes"] == ["hand first"]
    assert np.array_equal(impact.record.extras["crush"], np.array([0.5, 0.25]))
    record = from_block(list(LABELS), DATA, None, {"notes": ["hand first"]})
    assert record.extras == {"notes": ["hand first"]} and record.setup == {}
    record = from_block(list(LABELS), DATA, {"k": 1})
    assert record.extras == {} and record.setup == {"k": 1}


@pytest.mark.parametrize("notes", ["one", 5, [5], {"a": 1}, None])
def test_notes_that_are_no_texts_make_an_impact_incomplete(notes: object) -> None:
    sent = blocks()
    sent[-1] = replace(sent[-1], extras={"notes": notes})
    assembler = Assembler()
    (impact,) = [impact for block in sent for impact in assembler.feed(travelled(block))]
    assert impact.record is None and "notes: must be a list of texts" in impact.problem


def test_extras_that_only_begin_like_numbers_stay_as_they_are() -> None:
    odd = {"ragged": [[1.0], 2.0], "words": [1.0, "x"], "empty": [], "integers": [1, 2]}
    sent = blocks()
    sent[-1] = replace(sent[-1], extras=odd)
    assembler = Assembler()
    (impact,) = [impact for block in sent for impact in assembler.feed(travelled(block))]
    assert impact.record is not None and impact.record.extras == odd


@pytest.mark.parametrize(
    "change",
    [
        {"impact_id": "a\x1b[2J"}, {"impact_id": ""}, {"impact_id": "a" * 201},
        {"impact_id": "\u202e"}, {"total": 10**30}, {"start_time": float("nan")},
        {"start_time": 1e300}, {"start_time": -1.0}, {"start_time": True}, {"first": True},
        {"setup": [1]}, {"extras": "x"}, {"model": 3}, {"aborted": {}},
    ],
)  # fmt: skip
def test_a_header_with_other_types_or_beyond_all_bounds_is_refused(change: dict) -> None:
    header = {"impact_id": "a", "first": 0, "total": 1, "start_time": 1.0} | change
    with pytest.raises(IncompleteError, match="not a block of samples"):
        parse_block(json.dumps(header), "time,x", [0.0, 1.0])


def test_the_largest_values_of_a_header_are_taken() -> None:
    largest = {"impact_id": "é" * 200, "first": 10**8 - 1, "total": 10**8, "start_time": 2**31 - 1}
    assert parse_block(json.dumps(largest), "time", [0.0]).start_time == 2**31 - 1
    for key, beyond in (("impact_id", "é" * 201), ("total", 10**8 + 1), ("start_time", 2**31)):
        with pytest.raises(IncompleteError):
            parse_block(json.dumps(largest | {key: beyond}), "time", [0.0])


def test_headers_and_labels_that_would_raise_anything_are_refused() -> None:
    good = json.dumps({"impact_id": "a", "first": 0, "total": 1, "start_time": 1.0})
    cases = [("[" * 100_000, "time", [0.0]), ("1" * 5000, "time", [0.0]), (good, "a,a", [0.0, 0.0]),
             (good, None, [0.0]), (3, "time", [0.0]), (good, "time", [[1.0], 2.0]),
             (good, "time", [10**400])]  # fmt: skip
    for header, labels, data in cases:
        with pytest.raises(IncompleteError, match="not a block of samples"):
            parse_block(header, labels, data)


def test_a_joint_without_velocity_is_named() -> None:
    labels = [label for label in LABELS if label != "joint_velocity.knee"]
    with pytest.raises(PulseError, match=r"no column 'joint_velocity\.knee'"):
        from_block(labels, DATA[:, :-1])


def test_notes_and_crush_map_arrive_with_the_last_block() -> None:
    crush, place = np.array([0.1, 1.0 / 3.0]), np.array([[0.0, 0.1, 0.2], [1.0, 2.0, 3.0]])
    sent = blocks()
    sent[-1] = replace(
        sent[-1], extras={"notes": ["hand first"], "crush": crush, "column_position": place}
    )
    assembler = Assembler()
    (impact,) = [impact for block in sent for impact in assembler.feed(travelled(block))]
    assert impact.record is not None
    extras = impact.record.extras
    assert extras["notes"] == ["hand first"]
    assert np.array_equal(extras["crush"], crush)
    assert np.array_equal(extras["column_position"], place)


def test_the_digest_of_a_setup_is_that_of_its_canonical_json() -> None:
    text = r'{"a":"\u00e4","b":[0.1,1e-05,true,null]}'
    setup = {"b": [0.1, 1e-5, True, None], "a": "ä"}
    expected = hashlib.sha256(text.encode()).hexdigest()
    assert setup_digest(setup) == setup_digest(dict(reversed(setup.items()))) == expected
    with pytest.raises(ValueError, match="JSON"):
        setup_digest({"a": float("nan")})
