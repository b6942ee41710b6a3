"""Every error that lpvhinf raises on purpose.

A message names the argument, the value seen, the value wanted and the remedy.
"""

from __future__ import annotations

from typing import Any


class LpvHinfError(Exception):
    """Base of all errors of this package."""


class DimensionError(LpvHinfError, ValueError):
    """An array has a wrong shape, or sizes of connected systems disagree."""


class DomainError(LpvHinfError, ValueError):
    """A value lies outside its set: p outside P, NaN, a negative frequency, an unknown option."""


class AssumptionError(LpvHinfError, ValueError):
    """A mathematical assumption does not hold: M not positive definite, too few actuators, ..."""


class SynthesisError(LpvHinfError, RuntimeError):
    """A synthesis ended without a usable controller; `result` holds what was reached."""

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


class StorageError(LpvHinfError, OSError):
    """A file of ours is missing, damaged or of another kind than expected."""


class LpvHinfWarning(UserWarning):
    """A result is usable, but the user should know what to expect of it."""
