"""Loops that are designed here are certified, saved, and checked again: both observers and LPV synthesis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lpvhinf as lh
from lpvhinf.certify.largest import centred_box
from lpvhinf.certify.verdict import recheck
from lpvhinf.checks import Array
from lpvhinf.codesign import Design, Specification, codesign
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.lpv import lpvsyn, monomials
from lpvhinf.lpv.bounded_real import frozen_norm
from lpvhinf.statespace import LPVStateSpace
from tests.lpv.small_plants import moving_mode

Certificate = lh.certify.Certificate
BOX = [[-1.0, 1.0]]
QUICK: dict[str, Any] = {"starts": 1, "exchange_rounds": 0, "n_search": 4}
# of the width of the box: over all of it, no common matrix was found
SHARES = [("output-observer", 0.25), ("error-observer", 0.5), ("lpv", 0.125)]
LOOPS = ("rigid-body", "output-observer", "error-observer", "lpv")
WANTED = Specification(f_bw=[12.0, 15.0], expected_error=[2e-6, 5e-5], epsilon=0.05, Q=0.8)


@pytest.fixture(scope="module")
def loops(small_plant: DecoupledPlant) -> dict[str, LPVStateSpace]:
    """Closed loops by the way in which they were designed."""
    designs: dict[str, Design] = {}
    for architecture in LOOPS[:3]:
        start = designs.get("rigid-body")
        designs[architecture] = codesign(
            small_plant,
            architecture,
            WANTED,
            warm_start=start,
            n_positions=4,
            starts=1,
            max_iterations=10,
            exchange_rounds=1,  # without, the last one is unstable between its few positions
            n_search=8,
        )
    found = {name: design.closed_loop for name, design in designs.items()}
    return {**found, "lpv": lpv_loop()}


def lpv_loop() -> LPVStateSpace:
    """A moving mode with a gridded LPV controller, fitted by polynomials."""
    points = np.linspace(-1.0, 1.0, 5)[:, None]
    result = lpvsyn(moving_mode, points, basis=monomials(2, box=BOX), rate=[[-0.1, 0.1]])

    def plant(at: Array) -> tuple[Array, Array, Array, Array]:
        found = [moving_mode(p) for p in at]
        A, B = np.stack([P.A for P in found]), np.stack([np.hstack([P.B1, P.B2]) for P in found])
        C = np.stack([np.vstack([P.C1, P.C2]) for P in found])
        D = np.stack([np.block([[P.D11, P.D12], [P.D21, np.zeros((1, 1))]]) for P in found])
        return A, B, C, D

    loop = LPVStateSpace.interpolate(plant, box=BOX, degree=1).system.lft(result.to_lpv(8))
    norms = [frozen_norm(*(M[k] for M in loop.sample(points))) for k in range(len(points))]
    assert max(norms) == pytest.approx(max(result.frozen_norms), rel=1e-3)  # the loop that was designed
    return loop


@pytest.mark.parametrize("name", LOOPS)
def test_stability_at_every_position_is_proved_saved_and_checked(
    loops: dict[str, LPVStateSpace], tmp_path: Path, name: str
) -> None:
    proof = lh.certify.stability(loops[name])
    assert isinstance(proof, Certificate)
    assert proof.claim.box.tolist() == loops[name].box.tolist()
    accept(proof, loops[name], tmp_path)
    dense = np.linspace(*loops[name].box[0], 200)[:, None]
    assert np.max(np.linalg.eigvals(loops[name].A.sample(dense)).real) < 0.0


@pytest.mark.parametrize(("name", "share"), SHARES)
def test_one_lyapunov_matrix_is_proved_saved_and_checked(
    loops: dict[str, LPVStateSpace], tmp_path: Path, name: str, share: float
) -> None:
    proof = lh.certify.stability(loops[name], kind="quadratic", box=centred_box(loops[name].box, share))
    assert isinstance(proof, Certificate)
    accept(proof, loops[name], tmp_path)


def test_the_certificate_of_one_loop_says_nothing_of_another(loops: dict[str, LPVStateSpace], tmp_path: Path) -> None:
    proof = lh.certify.stability(loops["lpv"])
    assert isinstance(proof, Certificate)
    proof.save(tmp_path / "proof.npz")
    loops["output-observer"].save(tmp_path / "other.npz")
    verdict = recheck(tmp_path / "proof.npz", system=tmp_path / "other.npz")
    assert not verdict.proved
    assert "another system" in verdict.message


def test_a_designed_loop_that_is_unstable_between_its_positions_is_refuted(small_plant: DecoupledPlant) -> None:
    design = codesign(small_plant, "error-observer", WANTED, **QUICK, n_positions=3, max_iterations=10)
    found = lh.certify.stability(design.closed_loop)
    assert np.all(np.isfinite(design.gammas))  # stable where it was designed
    assert isinstance(found, lh.certify.Refutation)
    A = design.closed_loop.A.at(found.evidence.position)
    assert np.min(np.abs(np.linalg.eigvals(A) - found.evidence.eigenvalue)) < 1e-6
    assert found.evidence.eigenvalue.real > 0.0


def accept(proof: lh.certify.Certificate, system: LPVStateSpace, folder: Path) -> None:
    system.save(folder / "loop.npz")
    proof.save(folder / "proof.npz")
    verdict = recheck(folder / "proof.npz", system=folder / "loop.npz")
    assert verdict.proved, verdict.message
