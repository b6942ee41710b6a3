"""Progress on a terminal: a live line there, plain log lines elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from lpvhinf.progress import Progress


class TerminalProgress(Progress):
    """A live line with stage, iteration, best gamma and time left; log lines when there is no terminal.

    Use it as a context manager, so that the terminal is left clean also after an error.
    """

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bars

        self._console = Console(stderr=True)
        self._bars = Bars(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[figures]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._task = self._bars.add_task("starting", total=None, figures="")
        self._began = time.monotonic()

    def __enter__(self) -> TerminalProgress:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def stage(self, name: str, total: int | None = None) -> None:
        """Start a new bar, or write a line."""
        if self._console.is_terminal:
            self._bars.reset(self._task, description=name, total=total, figures="")
        else:
            self.log(name)

    def update(self, advance: int = 1, **values: float) -> None:
        """Move the bar and show the figures."""
        figures = "  ".join(f"{name} {value:.5g}" for name, value in values.items())
        self._bars.update(self._task, advance=advance, figures=figures)

    def log(self, message: str) -> None:
        """Write a line that stays."""
        line = f"{time.monotonic() - self._began:7.1f} s  {message}"
        if self._console.is_terminal:
            self._console.print(line, highlight=False)
        else:
            print(line, file=sys.stderr, flush=True)
