"""Memory of the nodes over many impacts; ``python -m bench.bench_memory`` measures its slope."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

import rclpy
from node_processes import DOMAIN
from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future

from bench.bench_memory import NODES, measured
from helmet_sim_ros.nodes.process import wait

IMPACTS = 160
#: Far more than the noise of a run, far less than a node that keeps its impacts [byte]: the
#: recorder once took 100 kB for each.
MOST = 3e6


def test_no_node_keeps_what_it_has_done_with(tmp_path: Path) -> None:
    counts, rows = measured(IMPACTS, per_file=50, folder=tmp_path)
    late = [row for count, row in zip(counts, rows, strict=True) if count >= IMPACTS // 2]
    grown = dict(zip(NODES, late[-1] - late[0], strict=True))
    assert max(grown.values()) < MOST, grown


def test_nothing_is_left_of_a_wait() -> None:
    """A node kept a reference to each timer it had waited with: 2 kB for every impact."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    node = rclpy.create_node("waiting", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        before = len(node.default_callback_group.entities), len(list(node.timers))

        async def waits() -> None:
            for _ in range(20):
                await wait(node, Future(), 1e-4)

        task = executor.create_task(waits)
        executor.spin_until_future_complete(task, timeout_sec=60.0)
        assert task.done()
        assert (len(node.default_callback_group.entities), len(list(node.timers))) == before
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
