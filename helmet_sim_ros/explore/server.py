"""The explorer's server: on this host only, at the next free port."""

from __future__ import annotations

import io
import socket
from contextlib import redirect_stdout

import viser

from helmet_sim_ros.errors import HelmetSimError

HOST = "127.0.0.1"
#: Ports tried from the one that was asked for.
_TRIED = 100


class LocalServer(viser.ViserServer):
    """viser's server without its tunnel to the outside."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refused: the page is for this host."""
        return None

    def stop(self) -> None:
        """End it, without viser's line about that."""
        with redirect_stdout(io.StringIO()):
            super().stop()


def free_port(wanted: int) -> int:
    """The first port from ``wanted`` on that nobody listens at.

    Raises:
        HelmetSimError: none of the next ones is free.
    """
    last = min(wanted + _TRIED, 65536)
    for port in range(wanted, last):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((HOST, port))
            except OSError:
                continue
            return port
    raise HelmetSimError(f"no free port from {wanted} to {last - 1} on {HOST}")


def start_server(wanted: int) -> LocalServer:
    """A server at ``wanted``, or at the next free port; ``get_port()`` tells."""
    port = free_port(wanted)
    with redirect_stdout(io.StringIO()):  # viser's own banner; the command prints its line
        return LocalServer(host=HOST, port=port, label="helmet-sim explore", verbose=False)


def address(server: viser.ViserServer) -> str:
    """Where the page is."""
    return f"http://{HOST}:{server.get_port()}"
