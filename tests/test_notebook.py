"""Guards what a notebook shows in place of text."""

from __future__ import annotations

import numpy as np

import lpvhinf as lh
from lpvhinf.notebook import properties, table


def test_text_cannot_become_markup() -> None:
    assert "<b>a &lt; b</b>" in table("a < b", [["<i>", "x"], ["y", "<script>"]])
    assert "<td>&lt;script&gt;</td>" in table("", [["h"], ["y", "<script>"]])
    assert "<td>gamma &gt; 1</td>" in properties("", [("status", "gamma > 1")])


def test_a_synthesis_result() -> None:
    plant = lh.GeneralizedPlant(
        [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], np.zeros((2, 2)), [[0.0], [1.0]], [[0.0, 1.0]]
    )
    constraint = lh.ClosedLoopPoles(decay=4.0)
    result = lh.hinfstruct(plant, lh.StaticGain(1, 1), constraints=[constraint], starts=1)
    shown = result._repr_html_()
    assert f"<th>gamma</th><td>{result.gamma:.6g}</td>" in shown
    assert "<th>stabilizing</th><td>yes</td>" in shown
    assert f"<th>constraint 1</th><td>{result.constraints[0].value:.6g}, holds</td>" in shown
