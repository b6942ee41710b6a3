"""Coils off their places and magnets off their strength, drawn at random from the effects' seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lpvhinf.checks import read_only
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.effects import Effects
from lpvhinf.plant.mmpa.magnets import MagnetArray

COILS, MAGNETS = 1, 2  # streams of random numbers of their own: switching one effect on does not change the other


def misplaced_layers(layers: Sequence[CoilLayer], effects: Effects) -> tuple[CoilLayer, ...]:
    """The coil layers with position errors, normal with ``effects.coil_position_rms`` along x and along y.

    Examples
    --------
    >>> from lpvhinf.plant.mmpa.coils import coil_layers
    >>> from lpvhinf.plant.mmpa.parameters import MMPAParameters
    >>> upper, lower = misplaced_layers(coil_layers(MMPAParameters()), Effects(coil_position_rms=20e-6))
    >>> upper.errors.shape, bool(15e-6 < upper.errors.std() < 25e-6)
    ((80, 2), True)
    """
    if not effects.coil_position_rms:
        return tuple(layers)
    rng = np.random.default_rng([effects.seed, COILS])
    return tuple(
        replace(layer, errors=read_only(rng.normal(0.0, effects.coil_position_rms, (layer.n_coils, 2))))
        for layer in layers
    )


def deviating_magnets(magnets: MagnetArray, effects: Effects) -> MagnetArray:
    """The magnets with all strengths deviating by ``magnet_strength`` and each by ``magnet_strength_rms``.

    Examples
    --------
    >>> from lpvhinf.plant.mmpa.magnets import magnet_array
    >>> from lpvhinf.plant.mmpa.parameters import MMPAParameters
    >>> weak = deviating_magnets(magnet_array(MMPAParameters()), Effects(magnet_strength=-0.01))
    >>> round(float(np.abs(weak.polarization).max()), 4)
    1.3365
    """
    if not (effects.magnet_strength or effects.magnet_strength_rms):
        return magnets
    rng = np.random.default_rng([effects.seed, MAGNETS])
    each = 1.0 + effects.magnet_strength_rms * rng.standard_normal(len(magnets.masses))
    factor = (1.0 + effects.magnet_strength) * each
    return replace(magnets, polarization=read_only(magnets.polarization * factor[:, None]))
