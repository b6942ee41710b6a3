"""What parameters of the planar actuator cannot be: impossible materials and geometry, a mover beside its coils."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lpvhinf.errors import DomainError

if TYPE_CHECKING:
    from lpvhinf.plant.mmpa.parameters import MMPAParameters

# Values beyond which no material goes; a value beyond them is in another unit.
LARGEST = {
    "remanence": (2.0, "T", "no magnet reaches it (NdFeB: 1.0-1.5 T)"),
    "youngs_modulus": (1.3e12, "Pa", "diamond reaches 1.2e12 Pa"),
    "plate_density": (23e3, "kg/m3", "osmium reaches 22.6e3 kg/m3"),
    "magnet_density": (23e3, "kg/m3", "osmium reaches 22.6e3 kg/m3"),
    "side": (10.0, "m", "lengths are in metres"),
}
SMALLEST = {
    "youngs_modulus": (1e6, "Pa", "the modulus is in Pa, not GPa"),
    "plate_density": (10.0, "kg/m3", "the density is in kg/m3"),
    "magnet_density": (10.0, "kg/m3", "the density is in kg/m3"),
}
THIN = 0.1  # thickness over side up to which the thin-plate theory of Kirchhoff is a fair model


def check_parameters(p: MMPAParameters) -> None:
    """Check values that are each a number of the right sign against each other and against nature.

    Raises
    ------
    DomainError
        If a material is impossible, parts overlap, a beam misses its mirror, the point of control leaves the mover, or
        the mover leaves the coils.
    """
    _materials(p)
    _mover(p)
    _stator(p)
    _sensors(p)
    check_coil_field(p)


def _materials(p: MMPAParameters) -> None:
    for name, (limit, unit, reason) in LARGEST.items():
        if getattr(p, name) > limit:
            raise DomainError(f"{name} is {getattr(p, name):.6g} {unit}, wanted at most {limit:.3g} {unit}: {reason}.")
    for name, (limit, unit, reason) in SMALLEST.items():
        if getattr(p, name) < limit:
            raise DomainError(f"{name} is {getattr(p, name):.6g} {unit}, wanted at least {limit:.3g} {unit}: {reason}.")
    if not 0.0 < p.poisson_ratio < 0.5:
        raise DomainError(f"poisson_ratio is {p.poisson_ratio}, wanted a value between 0 and 0.5.")


def _mover(p: MMPAParameters) -> None:
    if p.plate_thickness > THIN * p.side:
        raise DomainError(
            f"plate_thickness is {p.plate_thickness} m, wanted at most {THIN} of the side, {THIN * p.side:.4g} m: "
            "the bending of a thicker plate needs another theory than Kirchhoff's."
        )
    if not p.magnet_fill < 1.0:
        raise DomainError(f"magnet_fill is {p.magnet_fill}, wanted tau_m / tau below 1.")
    if p.magnet_limit > p.side / 2:
        raise DomainError(
            f"magnet_limit is {p.magnet_limit} m: magnets hang beyond the plate, wanted at most side / 2 = "
            f"{p.side / 2:.4g} m."
        )
    laid_out = p.magnet_count_half * p.magnet_pitch
    if laid_out < np.sqrt(2.0) * p.magnet_limit:
        raise DomainError(
            f"magnet_count_half is {p.magnet_count_half}: the array is laid out over +-{laid_out:.4g} m only, wanted "
            f"sqrt(2) magnet_limit = {np.sqrt(2.0) * p.magnet_limit:.4g} m to fill its corners. Raise the count."
        )
    if p.bar_points < 2:
        raise DomainError(f"bar_points is {p.bar_points}, wanted at least 2: a bar has two ends.")
    if p.bar_inset > p.side / 2 or 2 * p.bar_clearance >= p.side:
        raise DomainError(
            f"bar_inset is {p.bar_inset} m and bar_clearance {p.bar_clearance} m: the bars leave the plate, wanted "
            f"less than side / 2 = {p.side / 2:.4g} m."
        )
    if p.ritz_degree < 2:
        raise DomainError(f"ritz_degree is {p.ritz_degree}, wanted at least 2 (below, the plate cannot bend).")
    if p.field_taper > p.side / 2:
        raise DomainError(f"field_taper is {p.field_taper} m, wanted at most side / 2 = {p.side / 2} m.")


def _stator(p: MMPAParameters) -> None:
    if 2 * p.bundle_width >= min(p.coil_short, p.coil_long):
        raise DomainError(f"bundle_width is {p.bundle_width} m: the coil has no opening. Make it narrower.")
    for coil, pitch in (("coil_short", "pitch_short"), ("coil_long", "pitch_long")):
        if getattr(p, coil) > getattr(p, pitch):
            raise DomainError(
                f"{coil} is {getattr(p, coil)} m, wanted at most {pitch} = {getattr(p, pitch)} m: coils overlap."
            )


def _sensors(p: MMPAParameters) -> None:
    reach = p.travel + max(p.sensor_z_half_span, p.sensor_xy_half_span)
    if reach > p.side / 2:
        raise DomainError(
            f"travel + beam position is {reach:.4g} m: a beam leaves the mover of half side {p.side / 2:.4g} m. "
            "Reduce travel, sensor_z_half_span or sensor_xy_half_span."
        )
    if p.sensor_height > p.beam_top:
        raise DomainError(
            f"sensor_height is {p.sensor_height} m: the horizontal beams pass over the mirror bars, which end "
            f"{p.beam_top:.4g} m above the neutral plane. Lower the beams or raise bar_height."
        )
    away = max(abs(p.point_of_control[0]), abs(p.point_of_control[1])) + p.travel
    if away > p.side / 2:
        raise DomainError(
            f"point_of_control is {p.point_of_control}: with the travel of {p.travel} m it leaves the mover of half "
            f"side {p.side / 2:.4g} m. Move it towards the centre."
        )


def check_coil_field(p: MMPAParameters) -> None:
    """Check that all of P keeps the mover, and the windows of the commutation, over the coils.

    Raises
    ------
    DomainError
        If the mover or a window reaches beyond the coils.
    """
    short, long = p.coils_short * p.pitch_short / 2, p.coils_long * p.pitch_long / 2
    if p.travel + p.side / 2 > min(short, long):
        raise DomainError(
            f"travel is {p.travel} m: the edge of the mover gets {p.travel + p.side / 2:.4g} m from the middle of the "
            f"stator and leaves the coils, which end at {min(short, long):.4g} m. Reduce travel or add coils."
        )
    for name, axis, end in (("window_short", "short", short), ("window_long", "long", long)):
        outer = getattr(p, name)[1]
        if p.travel + outer > end:
            raise DomainError(
                f"{name} reaches {outer} m from the mover, with the travel {p.travel + outer:.4g} m from the middle of "
                f"the stator, beyond the coils that end at {end:.4g} m along their {axis} axis. Narrow the window, "
                "reduce travel or add coils."
            )
