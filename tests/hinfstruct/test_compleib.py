"""Static output feedback for COMPleib systems, against the smallest norms known.

The data live beside the project; the tests are skipped without them.
Source: F. Leibfritz, COMPleib 1.1 (2004); norms of HIFOO 3.501 and of the best run of any method.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lpvhinf.hinfstruct import StaticGain, hinfstruct
from lpvhinf.statespace.generalized import GeneralizedPlant

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "anchors" / "compleib"

pytestmark = pytest.mark.skipif(
    not (FOLDER / "reference.json").exists(), reason=f"the COMPleib data are not in {FOLDER}: benchmark skipped"
)


def load(name: str) -> tuple[GeneralizedPlant, float]:
    with np.load(FOLDER / f"{name}.npz") as data:
        plant = GeneralizedPlant(*[data[key] for key in ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")])
    reference = json.loads((FOLDER / "reference.json").read_text())["systems"][name]
    return plant, float(reference["best_known_gamma"])


@pytest.mark.parametrize("name", ["AC2", "AC4", "AC17", "HE1", "NN2", "NN17", "EB1", "EB2", "TF2", "REA3"])
def test_best_known_norm_is_reached(name: str) -> None:
    plant, best = load(name)
    result = hinfstruct(plant, StaticGain(plant.n_u, plant.n_y), starts=2, seed=1)
    assert result.stabilizing
    assert result.gamma <= 1.001 * best


@pytest.mark.slow
def test_a_norm_that_can_vanish() -> None:
    plant, _ = load("AC1")
    assert hinfstruct(plant, StaticGain(plant.n_u, plant.n_y), starts=6).gamma < 1e-3
