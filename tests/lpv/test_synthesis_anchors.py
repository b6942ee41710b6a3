"""The inequalities of published synthesis problems against infima recomputed in high precision.

The data live beside the project; the tests are skipped without them.
Source: F. Wu, X. H. Yang, A. Packard and G. Becker (1996); the LPVTools tutorials (G. J. Balas et al.).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.lpv.farkas import certificate
from lpvhinf.lpv.gridded import GriddedLMIs, gridded_lmis
from lpvhinf.lpv.solve_lmi import solve_lmi
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.lpv.small_plants import cosines

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "anchors" / "lpv"

pytestmark = pytest.mark.skipif(
    not (FOLDER / "wu1996_rotation.json").exists(), reason=f"the LPV data are not in {FOLDER}: anchors skipped"
)


def plant(data: dict[str, Any]) -> GeneralizedPlant:
    return GeneralizedPlant(*[np.array(data[key], float) for key in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21")])


def rotation(constant: str, rate: float, r_max: float = 1e6) -> GriddedLMIs:
    data = json.loads((FOLDER / "wu1996_rotation.json").read_text())
    plants = [plant(each) for each in data["generalized_plant_at_grid"]]
    grid = data["parameter"]["grid"]
    return gridded_lmis(plants, grid, basis=cosines, rate=rate, constant=constant, r_max=r_max)


@pytest.mark.parametrize("constant", ["none", "S"])
@pytest.mark.parametrize(("rate", "infimum"), [(5.0, 0.905246), (0.0, 0.798285)])
def test_rotation_plant(constant: str, rate: float, infimum: float) -> None:
    solution = solve_lmi(rotation(constant, rate).problem)
    assert solution.status == "optimal"
    assert solution.margin > 0.0
    assert infimum - 5e-7 <= solution.gamma <= 1.0001 * infimum
    assert solution.gamma_lower <= infimum * (1.0 + 1e-5)


@pytest.mark.parametrize("rate", [0.0, 5.0])
def test_rotation_plant_with_constant_R_is_infeasible(rate: float) -> None:
    lmis = rotation("R", rate)
    solution = solve_lmi(lmis.problem)
    assert solution.status == "infeasible"
    assert solution.certificate is not None
    checked = certificate(lmis.problem, list(solution.certificate.multipliers))
    assert checked is not None
    assert checked.value < 0.0


def test_early_stop_stays_within_two_percent() -> None:
    solution = solve_lmi(rotation("S", 5.0).problem, gap=1e-2)
    assert solution.status == "optimal"
    assert 0.905246 <= solution.gamma <= 0.9150


def test_tutorial_with_constant_matrices() -> None:
    data = json.loads((FOLDER / "lft_tutorial_first_order.json").read_text())
    lmis = gridded_lmis([plant(v) for v in data["vertices"]], [1.0, 10.0], constant="both")
    solution = solve_lmi(lmis.problem)
    assert solution.status == "optimal"
    assert 1.787676 <= solution.gamma <= 1.7878
