"""Sample blocks as ``std_msgs/Float64MultiArray`` messages."""

from __future__ import annotations

from array import array

from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from helmet_sim_ros.errors import IncompleteError
from helmet_sim_ros.mcap_log.blocks import Block, parse_block

TOPIC = "impact/samples"


def to_message(block: Block) -> Float64MultiArray:
    """A block as message: rows first, labels in the layout, values bit for bit."""
    rows, columns = block.data.shape
    layout = MultiArrayLayout(
        dim=[
            MultiArrayDimension(label=block.header(), size=rows, stride=rows * columns),
            MultiArrayDimension(label=",".join(block.labels), size=columns, stride=columns),
        ]
    )
    return Float64MultiArray(layout=layout, data=array("d", block.data.tobytes()))


def from_message(message: Float64MultiArray) -> Block:
    """The inverse of :func:`to_message`.

    Raises:
        IncompleteError: not a sample block.
    """
    if len(message.layout.dim) != 2:
        raise IncompleteError(f"not a block of samples: {len(message.layout.dim)} dimensions")
    header, labels = (dimension.label for dimension in message.layout.dim)
    return parse_block(header, labels, message.data)
