"""Serve a film over RTSP with GStreamer's server: a program for the system's Python, which has its bindings.

``/usr/bin/python3 rtsp_server.py FILM.mp4 PORT`` says ``serving`` once it listens; each client is sent the film from
its beginning. It imports nothing of TEGA. Debian's packages are named in ``tega_scene/test_peer_rtsp.py``.
"""

from __future__ import annotations

import sys
from typing import Any


def main(film: str, port: str) -> None:
    """Serve until it is ended."""
    import gi  # type: ignore[import-not-found,unused-ignore]  # of the system

    gi.require_version("Gst", "1.0")
    gi.require_version("GstRtspServer", "1.0")
    from gi.repository import GLib, Gst, GstRtspServer  # type: ignore[import-not-found,unused-ignore]

    Gst.init(None)
    server: Any = GstRtspServer.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(port)
    factory: Any = GstRtspServer.RTSPMediaFactory()
    # Parameter sets with every picture that stands alone, as a camera sends them.
    packets = "h264parse config-interval=-1 ! rtph264pay name=pay0 pt=96"
    factory.set_launch(f'( filesrc location="{film}" ! qtdemux ! {packets} )')
    server.get_mount_points().add_factory("/film", factory)
    if server.attach(None) == 0:
        raise SystemExit(f"port {port} is taken")
    sys.stdout.write("serving\n")
    sys.stdout.flush()
    GLib.MainLoop().run()


if __name__ == "__main__":
    main(*sys.argv[1:])
