"""Parameters of a node, made from a configuration."""

from __future__ import annotations

import math
import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

import rclpy
from node_processes import DOMAIN
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from helmet_sim_ros.errors import IncompleteError, SetupError
from helmet_sim_ros.mcap_log.blocks import Block
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.setup import ImpactSetup, setup_leaves
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.parameters import NODE_OPTIONS, Parameters, config_paths
from helmet_sim_ros.nodes.setup_parameters import NOT_A_PARAMETER, SimulationConfig, declare
from helmet_sim_ros.schema import Leaf, leaves


@pytest.fixture
def light(tmp_path: Path) -> str:
    """A helmet file that differs from the shipped one."""
    helmet = load_helmet("fullface").replaced({"mass": 1.2, "spring.energy_loss": 0.77})
    path = tmp_path / "light.yaml"
    path.write_text(yaml.safe_dump(helmet.model_dump(mode="json")))
    return str(path)


class Simulation(Node):
    def __init__(self) -> None:
        super().__init__("simulation", **NODE_OPTIONS)
        self.busy = ""
        self.settings: Parameters[SimulationConfig] = declare(self, lambda: self.busy)

    @property
    def setup(self) -> ImpactSetup:
        return self.settings.value.setup

    def change(self, **values: Any) -> str:
        """Set together, ``__`` for a dot; the reason if refused."""
        given = [Parameter(key.replace("__", "."), value=value) for key, value in values.items()]
        result = self.set_parameters_atomically(given)
        assert result.successful or result.reason
        return str(result.reason)


def create(*given: str) -> Simulation:
    arguments = [part for text in given for part in ("-p", text)]
    rclpy.init(args=["--ros-args", *arguments], signal_handler_options=SignalHandlerOptions.NO)
    return Simulation()


@pytest.fixture(autouse=True)
def context() -> Iterator[None]:
    os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    yield
    rclpy.try_shutdown()


def test_every_value_of_a_setup_is_a_described_ranged_parameter() -> None:
    node = create()
    expected = [*setup_leaves(), *leaves(Helmet, "helmet.")]
    for leaf in expected:
        if leaf.name == NOT_A_PARAMETER:
            continue
        descriptor = node.describe_parameter(leaf.name)
        assert leaf.unit in descriptor.description and len(descriptor.description) > 5, leaf.name
        if leaf.type is float:
            (allowed,) = descriptor.floating_point_range
            assert (allowed.from_value, allowed.to_value) == (leaf.minimum, leaf.maximum)
    assert node.setup == ImpactSetup()


@pytest.mark.parametrize(
    ("name", "given", "taken"),
    [
        ("impact.normal_velocity", 7, 7.0),
        ("sim.time_step", "2e-5", 2e-5),
        ("helmet.inertia", [1, 1, 1], (1.0, 1.0, 1.0)),
        ("helmet.inertia", "[1, 0.9, 1]", (1.0, 0.9, 1.0)),
        ("impact.neck_flexion_deg", 10, 10.0),
        ("impact.neck_flexion_deg", "unset", None),
        ("impact.neck_flexion_deg", None, None),
    ],
)
def test_what_is_plainly_meant_is_accepted(name: str, given: Any, taken: Any) -> None:
    node = create()
    assert node.change(**{name: given}) == ""
    value = node.get_parameter(name).value
    assert value == (list(taken) if isinstance(taken, tuple) else taken) or tuple(value) == taken
    described = node.setup.described()
    if taken is None:
        assert node.setup.neck_flexion_deg is None
    else:
        assert described[name] == (list(taken) if isinstance(taken, tuple) else taken)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("impact.normal_velocity", float("nan"), "nan"),
        ("impact.normal_velocity", -1.0, "30"),
        ("impact.normal_velocity", 0.0, "above 0 to 30"),
        ("impact.normal_velocity", "fast", "must be a number from above 0 to 30"),
        ("impact.normal_velocity", True, "must be a number"),
        ("impact.body_angle_deg", 95.0, "90"),
        ("impact.direction", "up", "must be one of front, back, left, right, top"),
        ("rider.mass", 0, "30"),
        ("rider.mass", None, "must be a number"),
        ("helmet.name", "nosuch", "must be one of"),
        ("helmet.name", [1.0], "must be text"),
        ("helmet.inertia", [1.0, 2.0], "must be a list of 3 numbers"),
        ("helmet.inertia", [0.1, float("nan"), 0.1], "must be a list of 3 numbers"),
        ("helmet.inertia", "[1, {a: b}]", "must be a list of 3 numbers"),
        ("helmet.inertia", "{a: b}", "must be a list of 3 numbers"),
        ("impact.normal_velocit", 5.0, "unknown parameter; known: impact.normal_velocity"),
    ],
)
def test_what_is_wrong_is_refused_with_key_and_range_and_changes_nothing(
    name: str, value: Any, said: str
) -> None:
    node = create()
    reason = node.change(**{name: value})
    assert name in reason and said in reason
    assert node.setup == ImpactSetup()
    assert not node.has_parameter("impact.normal_velocit")


def test_values_set_together_are_all_taken_or_none() -> None:
    node = create()
    reason = node.change(impact__friction=0.2, helmet__mass=0.5, helmet__shell__effective_mass=0.9)
    assert "helmet.shell.effective_mass" in reason and "0.5" in reason
    assert node.get_parameter("impact.friction").value == ImpactSetup().friction
    # Each alone would contradict the other; together they fit.
    assert node.change(helmet__mass=0.5, helmet__shell__effective_mass=0.2) == ""
    assert node.setup.helmet_config.mass == 0.5


def test_a_change_during_an_impact_is_refused_with_the_reason() -> None:
    node = create()
    node.busy = "busy: impact 7 runs"
    assert node.change(impact__friction=0.2) == "busy: impact 7 runs"
    assert node.setup == ImpactSetup()
    assert node.change(use_sim_time=False) == ""  # not ours


def test_another_helmet_resets_the_helmet_but_not_what_is_set_with_it(light: str) -> None:
    node = create()
    shipped = load_helmet("fullface")
    assert node.change(helmet__spring__energy_loss=0.5) == ""
    assert node.change(helmet__name=light, helmet__mass=1.3) == ""
    assert node.get_parameter("helmet.spring.energy_loss").value == 0.77
    assert node.get_parameter("helmet.mass").value == 1.3
    assert node.setup.overrides == {"helmet.mass": 1.3}
    assert node.change(helmet__name="fullface") == ""
    assert node.setup.helmet_config == shipped
    assert node.get_parameter("helmet.mass").value == shipped.mass


def test_values_from_the_command_line_follow_the_same_rules(light: str) -> None:
    node = create("impact.normal_velocity:=5", f"helmet.name:={light}", "helmet.mass:=1")
    assert node.setup.normal_velocity == 5.0
    assert node.setup.helmet_config.mass == 1.0
    assert node.setup.helmet_config.spring.energy_loss == 0.77


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("impact.normal_velocity:=99", "impact.normal_velocity = 99.0: must be a number from"),
        ("impact.speed:=9", "impact.speed = 9: unknown parameter"),
        ("sim.publish_rate:=0", "sim.publish_rate = 0.0: must be"),
        ("helmet.mass:=heavy", "helmet.mass = 'heavy': must be"),
    ],
)
def test_a_node_does_not_start_with_a_wrong_value(given: str, said: str) -> None:
    with pytest.raises(SetupError) as refused:
        create(given)
    assert said in str(refused.value)


STRANGE = (
    "", "x" * 300, "x" * 5000, "../../etc/passwd", "a\nb", "\u202e", "\x00", "[" * 3000, "9" * 5000,
    "{", "!!python/object:x {}", "&a [*a]", "1e400", math.nan, math.inf, -math.inf, -1, 2**62, True,
    [1, 2, 3], [math.nan] * 3, ["a", "b"], [True], [b"a", b"b"], [0.1] * 1000,
)  # fmt: skip


def test_every_refusal_of_random_parameters_names_one_of_them() -> None:
    """175 of 2147 refusals named none of the parameters that were set, and a text of brackets or of
    digits left the client without any answer."""
    node, rng = create(), random.Random(5)
    leaves_by_name = {leaf.name: leaf for leaf in node.settings._leaves.values()}
    refused = 0
    for _ in range(150):
        chosen = rng.sample(sorted(leaves_by_name), rng.randint(1, 3))
        values = {
            name: rng.choice(STRANGE) if rng.random() < 0.4 else usual(leaves_by_name[name], rng)
            for name in chosen
        }
        before = node.setup
        reason = node.change(**values)
        if reason:
            refused += 1
            assert any(name in reason for name in chosen), (values, reason)
            assert "unexpected" not in reason, (values, reason)
            assert node.setup is before
    assert 40 < refused < 145


def usual(leaf: Leaf, rng: random.Random) -> Any:
    """A value within its range, which may still not go with the others."""
    if leaf.choices:
        return rng.choice(leaf.choices)
    if leaf.type is bool:
        return rng.random() < 0.5
    if leaf.type is tuple:
        return [rng.uniform(0.05, 0.2) for _ in range(leaf.length or 1)]
    if leaf.type in (float, int):
        low = 0.0 if leaf.minimum is None else leaf.minimum
        high = 10.0 if leaf.maximum is None else min(leaf.maximum, 1e4)
        return leaf.type(rng.uniform(low, high))
    return leaf.default


@pytest.mark.parametrize(
    "header", ['{"a":' * 10_000 + "1" + "}" * 10_000, "[" * 10_000, "9" * 5000]
)
def test_a_forged_message_is_refused_as_what_it_is(header: str) -> None:
    """It was told as "a callback failed: RecursionError"."""
    message = samples.to_message(
        Block("a", 0, 1, 0.0, ("time",), np.zeros((1, 1)), setup={"impact.friction": 0.1})
    )
    assert samples.from_message(message).setup == {"impact.friction": 0.1}
    message.layout.dim[0].label = header
    with pytest.raises(IncompleteError, match="not a block of samples"):
        samples.from_message(message)


def test_a_setup_that_is_not_the_one_of_its_digest_is_refused() -> None:
    """Nothing told that a setup had been changed on its way."""
    setup = {"impact.friction": 0.1}
    for change, right in (({}, True), ({"impact.friction": 0.2}, False)):
        message = samples.to_message(
            Block("a", 0, 1, 0.0, ("time",), np.zeros((1, 1)), setup=setup | change,
                  setup_digest=setup_digest(setup))
        )  # fmt: skip
        if right:
            assert samples.from_message(message).setup == setup
            continue
        with pytest.raises(IncompleteError, match="digest"):
            samples.from_message(message)


def test_what_the_operator_names_is_a_list_or_one_path_and_is_there(tmp_path: Path) -> None:
    """A path that was mistyped, or given without brackets, would have opened nothing in silence."""
    for given in (f"[{tmp_path}]", str(tmp_path)):
        assert config_paths(create(f"config_paths:={given}")) == [tmp_path]
        rclpy.try_shutdown()
    with pytest.raises(SetupError, match=r"config_paths = .*: no such file"):
        config_paths(create(f"config_paths:=[{tmp_path / 'none'}]"))
