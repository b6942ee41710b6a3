"""Parameters of the planar actuator: what cannot be is refused with the number and the limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.plant.mmpa import MMPAParameters
from lpvhinf.plant.mmpa.mover import mover


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"side": -0.3}, "side is -0.3"),
        ({"side": 300.0}, "lengths are in metres"),
        ({"turns": 99.5}, "turns is 99.5"),
        ({"turns": "many"}, "turns is 'many'"),
        ({"poisson_ratio": 0.6}, "poisson_ratio is 0.6"),
        ({"youngs_modulus": 70.0}, "in Pa, not GPa"),
        ({"plate_density": 2.7}, "plate_density is 2.7 kg/m3, wanted at least 10"),
        ({"plate_thickness": 0.04}, "wanted at most 0.1 of the side, 0.03 m"),
        ({"remanence": 2.4}, "remanence is 2.4 T, wanted at most 2 T"),
        ({"magnet_density": 76e3}, "osmium"),
        ({"damping": np.nan}, "damping"),
        ({"damping": -0.01}, "damping is -0.01"),
        ({"damping": 1.0}, "damping is 1.0"),
        ({"damping": (0.01, 8.0)}, r"damping is \(0.01, 8.0\)"),
        ({"damping": ()}, r"damping is \(\)"),
        ({"mass_heights": 1}, "mass_heights is 1, wanted True or False"),
        ({"magnet_fill": 1.0}, "magnet_fill is 1.0"),
        ({"magnet_limit": 0.16}, "magnets hang beyond the plate"),
        ({"magnet_count_half": 4}, "laid out over"),
        ({"gap": -0.001}, "gap is -0.001"),
        ({"gap": 0.0}, "gap is 0.0"),
        ({"layer_spacing": -1e-3}, "layer_spacing is -0.001"),
        ({"window_short": (0.2, 0.1)}, "window_short"),
        ({"field_taper": 0.2}, "field_taper"),
        ({"bundle_width": 0.02}, "no opening"),
        ({"coil_short": 0.041}, "coil_short is 0.041 m, wanted at most pitch_short = 0.04 m"),
        ({"ritz_degree": 1}, "ritz_degree"),
        ({"bar_points": 1}, "bar_points is 1"),
        ({"bar_clearance": 0.15}, "the bars leave the plate"),
        ({"sensor_height": 0.021}, "beams pass over the mirror bars, which end 0.02 m above"),
        ({"travel": 0.08}, r"travel \+ beam position is 0.16 m: a beam leaves the mover of half side 0.15 m"),
        ({"point_of_control": (0.1, 0.0, 0.0)}, "with the travel of 0.06 m it leaves the mover"),
    ],
)
def test_bad_parameters_are_named(changes, words):
    with pytest.raises(DomainError, match=words):
        MMPAParameters(**changes)


def test_a_point_of_control_has_three_coordinates():
    with pytest.raises(DimensionError, match="point_of_control has shape"):
        MMPAParameters(point_of_control=(0.0, 0.0))


def test_the_mover_stays_over_the_coils():
    # 16 coils of 40 mm along the short axis, 5 of 120 mm along the long one: the coils end at 320 and 300 mm
    with pytest.raises(DomainError, match=r"gets 0.21 m from the middle .* leaves the coils, which end at 0.18 m"):
        MMPAParameters(coils_long=3)
    with pytest.raises(DomainError, match=r"window_short reaches 0.23 m .* 0.29 m .* end at 0.24 m along their short"):
        MMPAParameters(coils_short=12)
    with pytest.raises(DomainError, match=r"window_long reaches 0.25 m .* 0.31 m .* end at 0.3 m along their long"):
        MMPAParameters(window_long=(0.153, 0.25))
    small = MMPAParameters(coils_short=14, travel=0.06, window_short=(0.1, 0.2))
    with pytest.raises(DomainError, match="leaves the coils"):
        replace(small, travel=0.131, sensor_z_half_span=0.01, sensor_xy_half_span=0.01)


def test_magnets_hang_over_no_edge():
    with pytest.raises(
        DomainError, match=r"the magnets reach 0.15 m from the centre of the plate, wanted at most side"
    ):
        mover(MMPAParameters(side=0.295, magnet_limit=0.1351, travel=0.05))


def test_damping_is_one_number_or_one_a_mode():
    assert MMPAParameters().damping_of(3).tolist() == [0.008] * 3
    assert MMPAParameters(damping=[0.001, 0.002, 0.003]).damping == (0.001, 0.002, 0.003)
    assert MMPAParameters(damping=(0.001, 0.002, 0.003)).damping_of(2).tolist() == [0.001, 0.002]
    assert MMPAParameters(damping=0.0).damping_of(2).tolist() == [0.0, 0.0]


def test_the_point_of_control_is_at_the_top_face():
    thick = MMPAParameters(plate_thickness=0.01, point_of_control=(0.01, 0.0, 0.002))
    assert MMPAParameters().point_height == 0.004
    assert thick.point_height == pytest.approx(0.007)
