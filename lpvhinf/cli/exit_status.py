"""What a command tells the shell: its exit status, and one line on the error stream where it fails."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

from lpvhinf.errors import LpvHinfError, LpvHinfWarning


def exit_status(work: Callable[[], int | None], *, interrupted: str = "nothing is lost") -> int:
    """Do the work; its status, 0 if it returns none, 1 after an error of ours, 130 after an interrupt.

    The line of an interrupt ends with `interrupted`. Our warnings become lines too; others stay as they are.
    """
    before = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:
        if issubclass(category, LpvHinfWarning):
            print(f"warning: {message}", file=sys.stderr)
        else:
            before(message, category, *rest)

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", LpvHinfWarning)
            warnings.showwarning = show  # type: ignore[assignment]
            status = work()
    except LpvHinfError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"interrupted: {interrupted}", file=sys.stderr)
        return 130
    return 0 if status is None else status
