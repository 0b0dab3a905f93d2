"""The command line: `passiflex reproduce | simulate | audit | limits | robots`."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line; a mistake of the user ends with one line on what to do, not with a traceback."""
    from passiflex.cli.commands import app
    from passiflex.errors import PassiflexError

    try:
        status = app(sys.argv[1:], result_action="return_value")
    except PassiflexError as error:
        print(f"passiflex: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("passiflex: interrupted; nothing is half-written", file=sys.stderr)
        sys.exit(130)
    sys.exit(status if isinstance(status, int) else 0)
