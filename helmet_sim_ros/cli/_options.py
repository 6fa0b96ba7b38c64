"""Options that several verbs share."""

from __future__ import annotations

import click

domain_option = click.option(
    "--domain-id", type=click.IntRange(0, 232), help="ROS domain.  [default: ROS_DOMAIN_ID]"
)
