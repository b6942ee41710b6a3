"""The power amplifier of a coil: its current loop as a linear system, and its limits, resolution and noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.errors import DomainError

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, kw_only=True)
class Amplifier:
    r"""A current amplifier, the same for every coil.

    The current loop is a Butterworth low-pass of unit gain at zero frequency; at `bandwidth_hz` it is 3 dB down. What
    is not linear, `apply` does in a simulation: the converter rounds the wanted current, the current is limited, and
    from one sample to the next it goes no further than the voltage drives it through resistance and inductance.

    Parameters
    ----------
    current_limit : float
        Largest current of either sign [A].
    voltage : float
        Largest voltage of either sign [V].
    resistance, inductance : float
        Of a coil [ohm], [H]. The inductance is that of a rectangular coil of 100 turns of the benchmark's size, 1 mH;
        the voltage that motion induces (at most 2.2 V at 0.3 m/s and 7.4 N/A) is left out.
    bandwidth_hz : float or None
        Bandwidth of the current loop [Hz], in practice 2-5 kHz; None is infinitely fast.
    order : int
        Order of the current loop.
    bits : int or None
        The converter has ``2**bits`` steps over +-current_limit, the highest of which is left out; None has no steps.
    noise_rms : float
        White noise of the current, root mean square of a sample [A].

    Raises
    ------
    DomainError
        If a value is not of its range, or the voltage cannot drive the largest current through the resistance.

    Examples
    --------
    >>> amplifier = Amplifier(bandwidth_hz=3000.0)
    >>> round(amplifier.step * 1e6, 1), amplifier.apply([5.0, 1e-5]).tolist()
    (122.1, [3.9999, 0.0])
    """

    current_limit: float = 4.0
    voltage: float = 48.0
    resistance: float = 1.2
    inductance: float = 1e-3
    bandwidth_hz: float | None = 3000.0
    order: int = 2
    bits: int | None = 16
    noise_rms: float = 100e-6

    def __post_init__(self) -> None:
        for name, unit in (("current_limit", "A"), ("voltage", "V"), ("resistance", "ohm"), ("inductance", "H")):
            positive(name, getattr(self, name), unit)
        if self.bandwidth_hz is not None:
            positive("bandwidth_hz", self.bandwidth_hz, "Hz")
        if whole_number("order", self.order, 1) > 8:
            raise DomainError(f"order is {self.order}, wanted a current loop of at most order 8.")
        if self.bits is not None and whole_number("bits", self.bits, 1) > 32:
            raise DomainError(f"bits is {self.bits}, wanted a converter of at most 32 bits.")
        if not 0.0 <= self.noise_rms < np.inf:
            raise DomainError(f"noise_rms is {self.noise_rms!r} A, wanted a finite number of at least 0.")
        if self.resistance * self.current_limit > self.voltage:
            raise DomainError(
                f"current_limit is {self.current_limit} A, but {self.voltage} V drive at most "
                f"{self.voltage / self.resistance:.4g} A through {self.resistance} ohm. Lower it or raise the voltage."
            )

    @property
    def step(self) -> float:
        """Step of the converter [A]; zero if it has none."""
        return 0.0 if self.bits is None else 2.0 * self.current_limit / 2**self.bits

    def state_space(self) -> control.StateSpace:
        r"""The current loop, from wanted to actual current of one coil.

        Examples
        --------
        >>> loop = Amplifier(bandwidth_hz=2000.0, order=2).state_space()
        >>> loop.nstates, round(float(abs(loop(2j * np.pi * 2000.0))), 4), round(float(loop.dcgain().item()), 12)
        (2, 0.7071, 1.0)
        """
        import control
        from scipy.signal import butter

        labels = {"inputs": ["i_wanted"], "outputs": ["i"]}
        if self.bandwidth_hz is None:
            return control.ss([], [], [], [[1.0]], **labels)
        omega = 2.0 * np.pi * self.bandwidth_hz
        # of unit bandwidth first, then scaled in time: the states stay of one size
        unit = control.ss(control.tf(*butter(self.order, 1.0, analog=True)))
        return control.ss(unit.A * omega, unit.B * omega, unit.C, unit.D, **labels)

    def apply(
        self,
        currents: ArrayLike,
        rng: np.random.Generator | None = None,
        *,
        previous: ArrayLike | None = None,
        interval: float | None = None,
    ) -> Array:
        r"""What the amplifiers make of wanted currents, apart from the current loop's dynamics.

        Parameters
        ----------
        currents : (...)
            Wanted currents [A].
        rng : numpy.random.Generator, optional
            Where the noise comes from; without it there is none.
        previous : (...), optional
            Currents one sample earlier [A]; with them the voltage limits the change.
        interval : float, optional
            Time between the samples [s]; wanted along with `previous`.

        Returns
        -------
        (...)
            Currents [A]. With V the voltage limit and :math:`\tau = L / R` they lie within
            :math:`i e^{-T/\tau} \pm (V / R)(1 - e^{-T/\tau})`.

        Raises
        ------
        DomainError
            If a number is not finite, or only one of `previous` and `interval` is given.
        DimensionError
            If `previous` has another shape.
        """
        wanted = finite_array("currents", currents)
        if (previous is None) != (interval is None):
            raise DomainError("previous and interval go together: pass both to limit the change, or neither.")
        out = np.clip(wanted, -self.current_limit, self.current_limit)
        if self.bits is not None:
            half = 2 ** (self.bits - 1)  # codes from -half to half - 1, as in two's complement
            out = self.step * np.clip(np.round(out / self.step), -half, half - 1)
        if previous is not None and interval is not None:
            before = finite_array("previous", previous, wanted.shape)
            decay = np.exp(-positive("interval", interval, "s") * self.resistance / self.inductance)
            reach = self.voltage / self.resistance * (1.0 - decay)
            out = np.clip(out, before * decay - reach, before * decay + reach)
        if rng is not None and self.noise_rms:
            out = out + rng.normal(0.0, self.noise_rms, out.shape)
        return np.asarray(out)
