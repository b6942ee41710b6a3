"""Guards notches and a free order of K_RB in a co-design: the same loop to begin with, better ends, files, refusals."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.codesign import Design, Specification, codesign, measure
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.positions import norms_at
from lpvhinf.codesign.report import figures
from lpvhinf.controllers import RigidBodyGains, RigidBodyStateSpace
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DomainError
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.storage import read_arrays

OPTIONS: dict[str, dict[str, Any]] = {"notches": {"n_notches": 2}, "free": {"order_K_RB": 4}}
HERTZ = np.geomspace(0.1, 2000.0, 200)


def assembly_with(design: Design, **options: Any) -> Assembly:
    specification = dataclasses.replace(design.specification, **options)
    return dataclasses.replace(design.assembly, specification=specification)


@pytest.fixture(scope="module", params=list(OPTIONS))
def option(request: pytest.FixtureRequest) -> dict[str, Any]:
    return OPTIONS[request.param]


@pytest.fixture(scope="module")
def better(option: dict[str, Any], small_plant: DecoupledPlant, rigid: Design) -> Design:
    """A conventional design with an option, begun with the one without."""
    assembly = assembly_with(rigid, **option)
    return codesign(
        small_plant, "rigid-body", assembly.specification, positions=rigid.positions,
        warm_start=assembly.translated(rigid.assembly, rigid.parameters), starts=1, max_iterations=12,
        exchange_rounds=0, n_search=4,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["rigid", "observer"])
def test_the_start_is_the_same_loop(name: str, option: dict[str, Any], request: pytest.FixtureRequest) -> None:
    """Also that of a design with an observer, whose L and xi are kept."""
    design: Design = request.getfixturevalue(name)
    assembly = assembly_with(design, **option)
    theta = assembly.translated(design.assembly, design.parameters)
    assert len(theta) == assembly.structure.n_parameters > len(design.parameters)
    found, wanted = (
        norms_at(assembly, theta, design.positions),
        norms_at(design.assembly, design.parameters, design.positions),
    )
    # coordinates of the free order are computed, those of the notches exact
    assert np.allclose(found, wanted, rtol=1e-10 if "n_notches" in option else 1e-7, atol=0.0)
    for own, plain in zip(assembly.split(theta)[1:], design.assembly.split(design.parameters)[1:], strict=True):
        assert np.array_equal(own, plain)


def test_notches_start_where_u_RB_drives_modes(small_plant: DecoupledPlant, rigid: Design) -> None:
    """The modes at 110 and 240 Hz; the preserved one at 60 Hz, which only disturbances reach, comes after them."""
    for n, wanted in ((1, [110.0]), (2, [110.0, 240.0]), (4, [110.0, 240.0, 60.0, 480.0])):
        structure = assembly_with(rigid, n_notches=n).rigid_body
        assert structure.gains(structure.parameters(structure.rule_of_thumb([12.0, 15.0]))).arrays()["f_n"] == (
            pytest.approx(np.array([wanted, wanted]))
        )
    every = dataclasses.replace(small_plant, input_decoupling="rigid-body")
    assembly = Assembly(plant=every, specification=Specification(n_notches=1), architecture="rigid-body")
    assert assembly.start(rigid.positions)[5] == pytest.approx(np.log(60.0))


def test_a_design_is_not_worse_than_its_start(better: Design, rigid: Design) -> None:
    assert better.stabilizing
    assert better.gamma <= rigid.gamma * (1.0 + 1e-7)
    assert better.gamma < 0.999 * rigid.gamma
    assert "gamma" in repr(better)


def test_the_controller_is_the_one_that_is_read(better: Design) -> None:
    K = better.K_RB.response(2 * np.pi * HERTZ)
    found = better.controller.at([0.03])(2j * np.pi * HERTZ)
    for i in range(2):
        assert np.max(np.abs(found[i, i] / K[:, i] - 1.0)) < 1e-8
    assert better.controller.n_x == 2 + better.assembly.rigid_body.n_x


def test_files_give_the_design_back(better: Design, tmp_path: Path) -> None:
    better.save(tmp_path)
    data = read_arrays(tmp_path / "design.npz", "lpvhinf.Design")
    assert np.allclose(norms_at(better.assembly, data["parameters"], better.positions), data["gammas"], rtol=1e-9)
    s = 2j * np.pi * HERTZ
    assert np.array_equal(
        LPVStateSpace.load(tmp_path / "controller.npz").at([0.03])(s), better.controller.at([0.03])(s)
    )
    again: RigidBodyGains | RigidBodyStateSpace
    if isinstance(better.K_RB, RigidBodyGains):
        five = dict(zip(("gain", "f_i", "f_d", "f_lp", "zeta_lp"), data["K_RB"], strict=True))
        again = RigidBodyGains(**five, **{name: data[f"K_RB_{name}"] for name in ("f_n", "zeta_num", "zeta_den")})
    else:
        assert "K_RB" not in data
        again = RigidBodyStateSpace(A=data["K_RB_A"], B=data["K_RB_B"], C=data["K_RB_C"])
    assert np.array_equal(again.response(abs(s)), better.K_RB.response(abs(s)))
    # and they are a start of a design with the same option
    theta = better.assembly.rigid_body.parameters(again)
    assert np.allclose(norms_at(better.assembly, theta, better.positions), better.gammas, rtol=1e-8)


def test_reports_name_the_option(better: Design) -> None:
    text = better.report()
    assert ("notches: f_n Hz" in text) == isinstance(better.K_RB, RigidBodyGains)
    assert ("K_RB of order 4" in text) == isinstance(better.K_RB, RigidBodyStateSpace)
    values = figures(better, measure(better, better.positions[:2]))
    assert set(values["K_RB"]) == set(better.K_RB.arrays())


def test_an_observer_design_with_an_option(
    option: dict[str, Any], small_plant: DecoupledPlant, observer: Design
) -> None:
    assembly = assembly_with(observer, **option)
    theta = assembly.translated(observer.assembly, observer.parameters)
    design = codesign(
        small_plant, "output-observer", assembly.specification, positions=observer.positions, warm_start=theta,
        max_iterations=3, exchange_rounds=0, n_search=2,
    )  # fmt: skip
    assert design.gamma <= observer.gamma * (1.0 + 1e-7)
    assert design.L is not None
    assert design.L.shape == (6, 3)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"n_notches": -1}, "n_notches is -1, wanted a whole number of at least 0"),
        ({"n_notches": 1.5}, "n_notches is 1.5"),
        ({"order_K_RB": 1}, "order_K_RB is 1, wanted a whole number of at least 2"),
        ({"order_K_RB": 2.0}, "order_K_RB is 2.0"),
        ({"n_notches": 1, "order_K_RB": 4}, "n_notches is 1 and order_K_RB is 4, wanted only one"),
    ],
)
def test_refusals(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(DomainError, match=message):
        Specification(**wrong)


def test_settings_from_a_file() -> None:
    assert Specification.from_mapping({"n_notches": 2}).n_notches == 2
    assert Specification.from_mapping({"order_K_RB": 3}).order_K_RB == 3
    assert (Specification().n_notches, Specification().order_K_RB) == (0, None)
