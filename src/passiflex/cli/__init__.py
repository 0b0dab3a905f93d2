"""The command line: `passiflex reproduce`, `simulate`, `audit`, `show`, `plot`, `limits`, `campaign` and others."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cyclopts import App


def application() -> App:
    """Return the command line with all its commands."""
    from passiflex.cli import (  # noqa: F401 - they register their commands
        campaign_commands,
        commands,
        view_commands,
    )
    from passiflex.cli.terminal import app

    return app


def main() -> None:
    """Run the command line; a mistake of the user ends with one line on what to do, not with a traceback."""
    from passiflex.errors import PassiflexError

    try:
        status = application()(sys.argv[1:], result_action="return_value")
    except PassiflexError as error:
        print(f"passiflex: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print(
            "passiflex: interrupted; nothing is half-written, and the same command goes on", file=sys.stderr
        )
        sys.exit(130)
    sys.exit(status if isinstance(status, int) else 0)
