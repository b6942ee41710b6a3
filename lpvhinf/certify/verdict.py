"""The verdict on a certificate file: proved, not proved, or not a certificate, each with one line that says why."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from lpvhinf.certify.checker import NotProved, check
from lpvhinf.certify.reader import NotACertificate, hash_of_system_file, read_certificate

PROVED, NOT_PROVED, NOT_A_CERTIFICATE = 0, 1, 2


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What a check found.

    Attributes
    ----------
    status : 0 proved, 1 not proved, 2 not a certificate
    message : str
        One line: the claim and what it was checked with, or what is wrong.
    """

    status: int
    message: str

    @property
    def proved(self) -> bool:
        """Whether the claim is proved."""
        return self.status == PROVED


def recheck(
    path: str | os.PathLike[str], *, exact: bool = False, system: str | os.PathLike[str] | None = None
) -> Verdict:
    """Check a certificate file again, from its bytes.

    Parameters
    ----------
    path : the certificate
    exact : bool
        Integers instead of floating point with bounds of its rounding; slower by a factor of about 100.
    system : path, optional
        What `LPVStateSpace.save` wrote: the system that the claim has to speak of.

    Examples
    --------
    >>> recheck("no such file").status
    2
    """
    try:
        it = read_certificate(path)
        if system is not None and hash_of_system_file(system, it["matrices"]) != it["system"]:
            return Verdict(
                status=NOT_PROVED, message="not proved: the claim speaks of another system than the one given"
            )
        check(it, exact=exact)
    except NotACertificate as reason:
        return Verdict(status=NOT_A_CERTIFICATE, message=f"not a certificate: {reason}")
    except NotProved as reason:
        return Verdict(status=NOT_PROVED, message=f"not proved: {reason}")
    except MemoryError:
        return Verdict(status=NOT_PROVED, message="not proved: out of memory")
    how = "integers" if exact else "floating point with bounds of its rounding"
    size = f"{it['n']} states, {len(it['cells'])} cells, {how}, system {it['system'][:16]}"
    condition = ", conditional on the remainder" if it["remainder"] == "sampled" else ""
    return Verdict(status=PROVED, message=f"proved{condition}: {claim(it)} ({size})")


def claim(it: dict[str, Any]) -> str:
    """The claim of a certificate in words, with every number that belongs to it."""
    if it["gamma"]:
        what = f"exponentially stable with L2 gain below {it['gamma']!r}"
    else:
        what = f"all eigenvalues of A(p) left of {-it['decay'] + 0.0!r} 1/s"
        if it["kind"] != "frozen":
            what = f"exponentially stable with decay rate above {it['decay']!r} 1/s"
    how = {
        "frozen": "at every fixed p",
        "quadratic": "for arbitrarily fast p(t)",
        "rate": f"for dp/dt in {it['speeds']}",
    }
    text = f"{what}, {how[it['kind']]} in {[[float(v) for v in row] for row in it['box']]}"
    if it["remainder"] != "none":
        largest = ", ".join(f"{name} {it[f'remainder_{name}'].max(initial=0.0):.3g}" for name in it["matrices"])
        text += f", with deviations of the matrices of up to {largest} ({it['remainder']})"
    return text
