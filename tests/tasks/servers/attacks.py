"""What a page of another site would send to a server on this machine, from a browser and without one."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Final
from urllib.parse import urlsplit

EVIL: Final = "http://evil.example"
STEPS: Final = {"pull_steps": [{"prefect.deployments.steps.run_shell_script": {"script": "touch attacked"}}]}
# Ask another site for anything: whether that got there.
ELSEWHERE: Final = """
fetch(arguments[0], {mode: "no-cors"}).then(() => arguments[1]("reached"), () => arguments[1]("refused"));
"""
# Read, change, change without asking first, and open a websocket: what a page learns of each.
ATTACK: Final = """
const [address, steps, done] = arguments;
const status = (method, options) => fetch(address, {method, ...options})
    .then(answer => answer.type === "opaque" ? "opaque" : answer.status, () => "refused");
const json = {headers: {"Content-Type": "application/json"}, body: JSON.stringify(steps)};
const socket = new Promise(resolve => {
    const url = new URL("/api/events/in", new URL(address, location)).href.replace("http", "ws");
    const opened = new WebSocket(url, "prefect");
    opened.onopen = () => resolve("open");
    opened.onerror = () => resolve("closed");
});
(async () => done({
    read: await status("GET"),
    changed: await status("PATCH", json),
    sent: await status("POST", {mode: "no-cors", body: JSON.stringify(steps)}),
    socket: await socket,
}))();
"""


class _Page(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<title>evil</title>")

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def evil_page() -> Iterator[str]:
    """Address of a page of another site."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Page) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"{EVIL}:{server.server_port}/"
        finally:
            server.shutdown()


def websocket_status(url: str, headers: Mapping[str, str]) -> int:
    """The status with which a websocket's handshake is answered; 101: it is open."""
    with open_websocket(url, headers) as connection:
        return int(connection.recv(1000).split()[1])


def open_websocket(url: str, headers: Mapping[str, str]) -> socket.socket:
    """A connection over which the handshake of a websocket was sent, and nothing else."""
    address = urlsplit(url)
    sent = {"Host": address.netloc, "Upgrade": "websocket", "Connection": "Upgrade"} | dict(headers)
    sent |= {"Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="}
    sent |= {"Sec-WebSocket-Protocol": "prefect"}
    lines = [f"GET {address.path} HTTP/1.1", *(f"{name}: {value}" for name, value in sent.items())]
    connection = socket.create_connection((address.hostname, address.port), timeout=10)
    connection.sendall("\r\n".join([*lines, "", ""]).encode())
    return connection
