"""A network camera over HTTP: multipart JPEG, as many such cameras serve it."""

from __future__ import annotations

import contextlib
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import cv2

from reference.filmed import SIZE, numbered

RATE_HZ = 20.0
WIDE, HIGH = 2 * SIZE[0], 2 * SIZE[1]


class FilmServer:
    """Serves numbered pictures on a port of this machine, 0 for any, while the block runs.

    ``ready`` pictures are sent at once, as by a sender that has kept them.
    """

    def __init__(self, port: int = 0, *, ready: int = 0) -> None:
        ended = self._ended = threading.Event()

        class Answering(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                number, sent = 0, b""
                with contextlib.suppress(OSError):
                    while not ended.is_set():
                        image = cv2.resize(numbered(number % 256), (WIDE, HIGH))
                        data = cv2.imencode(".jpg", image)[1].tobytes()
                        head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                        sent += head.encode() + data + b"\r\n"
                        number += 1
                        if number > ready:
                            self.wfile.write(sent)
                            sent = b""
                            time.sleep(1 / RATE_HZ)

            def log_message(self, *_: Any) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Answering)
        self._server.daemon_threads = True
        self.port = self._server.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/film.mjpg"

    def __enter__(self) -> FilmServer:
        """Serve."""
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the port, and every film that goes on."""
        self._ended.set()
        self._server.shutdown()
        self._server.server_close()
