"""Serve a run as JSON over WebSocket: records go out by name, closure and arm poses come in under the run's limits."""
