"""Progress is injected: numerics report to a `Progress`, and never print.

`Progress` itself is the silent variant. The command line passes one that draws
bars or writes log lines; tests pass one that records.
"""

from __future__ import annotations


class Progress:
    """A silent listener; override what you want to hear.

    Long computations call `stage` once for each part of the work, `update` after
    every step of it, and `log` for a message worth keeping.
    """

    def stage(self, name: str, total: int | None = None) -> None:
        """A new stage of the work begins; `total` steps are expected, if known."""

    def update(self, advance: int = 1, **values: float) -> None:
        """`advance` steps are done; `values` are figures worth showing, such as gamma."""

    def log(self, message: str) -> None:
        """A message worth keeping."""


SILENT = Progress()
