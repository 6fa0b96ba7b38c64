"""Explore impacts in the browser: turn a value, see the head's answer at once."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from pathlib import Path

import click
from rich.console import Console

from helmet_sim_ros.cli._processes import termination_as_interrupt
from helmet_sim_ros.extra import need

#: Asked for where no port is given.
DEFAULT_PORT = 8123


@click.command()
@click.argument("files", nargs=-1, metavar="[FILE]...")
@click.option("--port", default=DEFAULT_PORT, show_default=True, type=click.IntRange(1, 65535),
              help="Where the page is served; if it is in use, the next free one.")  # fmt: skip
@click.option("--no-browser", is_flag=True, help="Do not open a browser.")
def command(files: tuple[str, ...], port: int, no_browser: bool) -> None:
    """Serve a page, on this host only, on which every value of an impact can be turned.

    FILE: scenario files, whose cases become presets, and logs (.mcap), whose impacts can be
    stepped through; the first log is opened. Until Ctrl-C.
    """
    need("viser", "explore")
    need("markupsafe", "explore")
    from helmet_sim_ros.explore.page import Page
    from helmet_sim_ros.explore.server import address, start_server

    logs = [Path(name) for name in files if name.endswith(".mcap")]
    scenarios = [name for name in files if not name.endswith(".mcap")]
    console = Console(highlight=False)
    with termination_as_interrupt():
        server = start_server(port)
        try:
            page = Page(server, scenarios)
            try:
                for problem in page.problems:
                    console.print(problem, style="red", markup=False, soft_wrap=True)
                if server.get_port() != port:
                    console.print(f"port {port} is in use; taking {server.get_port()}")
                console.print(f"{address(server)}  (Ctrl-C ends it)", soft_wrap=True)
                page.start(logs[0] if logs else None)
                if not no_browser and _has_screen():
                    webbrowser.open(address(server))
                threading.Event().wait()
            except KeyboardInterrupt:
                pass
            finally:
                page.close()
        finally:
            server.stop()


def _has_screen() -> bool:
    """Whether a browser with windows can be opened; one in the terminal would take it over."""
    shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return sys.platform != "linux" or bool(shown)
