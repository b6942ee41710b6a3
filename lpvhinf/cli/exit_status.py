"""What a command tells the shell: its exit status, and one line on the error stream where it fails."""

from __future__ import annotations

import sys
from collections.abc import Callable

from lpvhinf.errors import LpvHinfError


def exit_status(work: Callable[[], None], *, interrupted: str = "nothing is lost") -> int:
    """Do the work; 0, 1 after an error of ours, 130 after an interrupt, whose line ends with `interrupted`."""
    try:
        work()
    except LpvHinfError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"interrupted: {interrupted}", file=sys.stderr)
        return 130
    return 0
