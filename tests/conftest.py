"""What every test starts from, however the tests were started."""

from __future__ import annotations

import signal


def pytest_configure() -> None:
    """Let processes of tests hear Ctrl-C and a lost terminal: behind `&` and nohup both are ignored, and inherited."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
