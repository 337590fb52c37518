"""An HTTP server on this machine that sends parts of files, and counts what it sends."""

from __future__ import annotations

import contextlib
import http.server
import re
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass
class Loopback:
    """A server of a folder.

    Parameters
    ----------
    folder
        What it serves.
    requests
        Method and path of every request, in order.
    sent
        Bytes of every file that were sent, by its name.
    """

    folder: Path
    url: str = ""
    requests: list[tuple[str, str]] = field(default_factory=list)
    sent: dict[str, int] = field(default_factory=dict)

    def of(self, path: Path) -> str:
        """Return a file's URL."""
        return f"{self.url}/{path.relative_to(self.folder)}"


@contextlib.contextmanager
def serving(folder: Path) -> Iterator[Loopback]:
    """Serve a folder on loopback until the block ends."""
    loopback = Loopback(folder)

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_HEAD(self) -> None:
            self.answer(is_head=True)

        def do_GET(self) -> None:
            self.answer(is_head=False)

        def answer(self, is_head: bool) -> None:
            name = self.path.partition("?")[0].lstrip("/")
            loopback.requests.append((self.command, name))
            file = folder / name
            if not file.is_file():
                self.send_error(404)
                return
            size = file.stat().st_size
            asked = re.match(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
            first = int(asked[1]) if asked else 0
            last = min(int(asked[2] or size) if asked else size, size - 1)
            self.send_response(206 if asked else 200)
            if asked:
                self.send_header("Content-Range", f"bytes {first}-{last}/{size}")
            self.send_header("Accept-Ranges", "bytes")
            self.send_header("Content-Length", str(last + 1 - first))
            self.end_headers()
            if is_head:
                return
            with file.open("rb") as opened:
                opened.seek(first)
                content = opened.read(last + 1 - first)
            loopback.sent[name] = loopback.sent.get(name, 0) + len(content)
            self.wfile.write(content)

        def log_message(self, *_: Any) -> None:
            """Keep the tests' output clean."""

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        loopback.url = f"http://127.0.0.1:{server.server_address[1]}"
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield loopback
        finally:
            server.shutdown()
            thread.join()
