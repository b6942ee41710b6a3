"""From a search to a certificate, or to what it left open."""

from __future__ import annotations

import time
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from lpvhinf.certify.cells import preorder
from lpvhinf.certify.claim import Certificate, Claim, Undecided
from lpvhinf.certify.search import Search
from lpvhinf.certify.system import CanonicalSystem
from lpvhinf.checks import Array


def outcome(
    claim: Claim,
    system: CanonicalSystem,
    remainder: dict[str, Array],
    search: Search,
    degree: int,
    lyapunov_degree: int,
    started: float,
    lyapunov: dict[str, Any] | None = None,
) -> Certificate | Undecided:
    """The certificate of a complete search, or what it left open."""
    seconds = time.process_time() - started
    n_p = len(claim.box)
    if search.reason:
        return Undecided(
            claim=claim,
            reason=search.reason,
            remaining=np.array([cell.bounds(claim.box) for cell in search.remaining]).reshape(-1, n_p, 2),
            proved=np.array([cell.bounds(claim.box) for cell in search.proved]).reshape(-1, n_p, 2),
            proved_share=search.proved_share,
            cpu_time=seconds,
        )
    tree, leaves = preorder(search.splits, n_p)
    margins = np.array([search.proved[leaf][0] for leaf in leaves])
    members = {**system.arrays(), "box": np.asarray(claim.box), "tree": tree}
    members |= {f"remainder_{name}": bound for name, bound in remainder.items()}
    layout = "cells" if lyapunov is None else "global"
    if lyapunov is None:
        records = [search.proved[leaf][1] for leaf in leaves]
        lyapunov = {name: np.stack([record[name] for record in records]) for name in ("S", "X")}
    header = {
        "format": 1,
        "claim": claim.header(),
        "system": system.hash,
        "proof": {"layout": layout, "degree": degree, "lyapunov_degree": lyapunov_degree},
        "producer": {"program": "lpvhinf", "version": _version(), "numpy": np.__version__},
    }
    return Certificate(
        claim=claim,
        n_cells=len(leaves),
        margin=float(margins.min()),
        cells=np.array([leaf.bounds(claim.box) for leaf in leaves]),
        margins=margins,
        cpu_time=seconds,
        header=header,
        members={**members, **lyapunov},
    )


def _version() -> str:
    try:
        return version("lpvhinf")
    except PackageNotFoundError:
        return "unknown"


def nothing(claim: Claim, reason: str, started: float) -> Undecided:
    """Nothing is proved, and no cell was tried."""
    n_p = len(claim.box)
    return Undecided(
        claim=claim,
        reason=reason,
        remaining=claim.box[None],
        proved=np.zeros((0, n_p, 2)),
        proved_share=0.0,
        cpu_time=time.process_time() - started,
    )
