"""Guards what a user asks for: defaults of the paper, per-axis values, and refusal of anything unknown."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import numpy as np
import pytest

from lpvhinf.codesign.specification import Specification
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError, LpvHinfWarning
from lpvhinf.plant import ModalModel

OMEGA_FLEX = 2 * np.pi * np.array([139.4, 206.5])


def test_defaults_are_the_papers() -> None:
    filters = Specification(f_bw=40.0).filters(OMEGA_FLEX, n_rb=6)
    assert np.array_equal(filters.f_I, np.full(6, 10.0))
    assert np.array_equal(filters.f_r, np.full(6, 160.0))
    assert (filters.alpha, filters.K_s, filters.K_r) == (20.0, 0.5, 0.5)
    assert filters.beta_1 > filters.beta_2
    assert np.array_equal(filters.epsilon, np.full(2, Specification().epsilon))
    assert np.array_equal(filters.omega_flex, OMEGA_FLEX)
    assert Specification().delay == 0.0


def test_expected_errors() -> None:
    assert Specification().errors(6).tolist() == [1e-6] * 3 + [1e-5] * 3
    assert Specification().errors(2).tolist() == [1e-6] * 2
    assert Specification(expected_error=3e-6).errors(6).tolist() == [3e-6] * 6
    assert Specification(expected_error=[1e-6, 2e-6]).errors(2).tolist() == [1e-6, 2e-6]


def test_values_for_every_axis_and_mode() -> None:
    wanted = Specification(f_bw=[20.0, 40.0], epsilon=(0.03, 0.1), integral_ratio=0.5, roll_off_ratio=3.0)
    filters = wanted.filters(OMEGA_FLEX, n_rb=2)
    assert filters.f_I.tolist() == [10.0, 20.0]
    assert filters.f_r.tolist() == [60.0, 120.0]
    assert filters.epsilon.tolist() == [0.03, 0.1]
    assert wanted.bandwidths(2).tolist() == [20.0, 40.0]
    with pytest.raises(DomainError, match="f_bw has 2 values, wanted 1 or 6"):
        wanted.bandwidths(6)
    with pytest.raises(DomainError, match="epsilon has 2 values, wanted 1 or 1"):
        wanted.filters(OMEGA_FLEX[:1], n_rb=2)


def test_one_entry_serves_all() -> None:
    assert Specification(f_bw=[30.0]).bandwidths(3).tolist() == [30.0] * 3


def test_settings_from_a_file() -> None:
    settings = {"f_bw": [30.0, 40.0], "Q": 2.0, "delay": 1e-4}
    assert Specification.from_mapping(settings) == Specification(f_bw=(30.0, 40.0), Q=2.0, delay=1e-4)
    assert Specification.from_mapping({}) == Specification()
    assert dataclasses.asdict(Specification.from_mapping(settings))["f_bw"] == (30.0, 40.0)


def test_unknown_settings_are_errors_that_list_the_known() -> None:
    with pytest.raises(DomainError, match=r"no option 'bandwidth'.*Known:.*epsilon.*f_bw"):
        Specification.from_mapping({"bandwidth": 40.0})


@pytest.mark.parametrize(
    "name",
    ["f_bw", "expected_error", "integral_ratio", "roll_off_ratio", "alpha", "K_s", "K_r", "epsilon", "beta_1", "Q"],
)
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "40"])
def test_invalid_values(name: str, value: Any) -> None:
    with pytest.raises(DomainError, match=name):
        Specification(**{name: value})


@pytest.mark.parametrize(
    "wrong",
    [{"delay": -1e-4}, {"delay": np.nan}, {"delay": "x"}, {"delay_order": 0}, {"beta_2": 0.0}, {"f_bw": [40.0, 0.0]}],
)
def test_other_invalid_values(wrong: dict[str, Any]) -> None:
    with pytest.raises(DomainError, match=next(iter(wrong))):
        Specification(**wrong)


def test_dampings_must_make_a_peak() -> None:
    with pytest.raises(DomainError, match="wanted beta_1 > beta_2"):
        Specification(beta_1=0.05, beta_2=0.05)


def test_a_bandwidth_above_a_discarded_mode_warns(small_plant: DecoupledPlant) -> None:
    """The first discarded mode of the small plant is at 110 Hz."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Specification(f_bw=[20.0, 109.0]).warn_if_demanding(small_plant)
    with pytest.warns(
        LpvHinfWarning, match=r"f_bw = 111\.0 Hz.*discarded mode at 110\.0 Hz.*expect gamma.*Raise n_flex"
    ):
        Specification(f_bw=[20.0, 111.0]).warn_if_demanding(small_plant)


def test_no_discarded_mode_no_warning(small_modal: ModalModel) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Specification(f_bw=500.0).warn_if_demanding(decouple(small_modal, n_flex=3, degree=4))
