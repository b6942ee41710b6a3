"""What a benchmark is: one question, and cases in which two ways give the same answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Case:
    """One size of a problem, solved in two ways.

    Attributes
    ----------
    size : str
        The sizes, for the report.
    ours, baseline : callable
        Each solves the problem once and returns the answer.
    difference : callable
        (answer of ours, answer of the baseline) -> a number that tells how far they are apart.
    accepted : (float, float)
        The case counts only if the difference lies in this range.
    """

    size: str
    ours: Callable[[], Any]
    baseline: Callable[[], Any]
    difference: Callable[[Any, Any], float]
    accepted: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """A question about speed.

    Attributes
    ----------
    name : str
        Its name on the command line.
    question : str
        What the ratio answers.
    ours, baseline : str
        The two ways, in words.
    difference : str
        What the number in the column of differences is.
    limitation : str
        What the ratio does not tell.
    cases : callable
        Builds the cases; work done here is not timed.
    """

    name: str
    question: str
    ours: str
    baseline: str
    difference: str
    limitation: str
    cases: Callable[[], Iterable[Case]]
