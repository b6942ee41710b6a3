"""The figures of a design that reports quote."""

from __future__ import annotations

from typing import Any

import numpy as np

from lpvhinf.codesign.complexity import complexity
from lpvhinf.codesign.design import Design
from lpvhinf.codesign.measures import Measures


def decibel(value: float) -> float:
    """20 log10 of a gain."""
    return float(20.0 * np.log10(value)) if value > 0.0 else -np.inf


def figures(design: Design, measures: Measures) -> dict[str, Any]:
    """The figures that a report quotes, for JSON: SI units but Hz, mm and dB where the name says so."""
    worst = int(np.argmax(np.max(measures.flexible_peak, axis=1, initial=0.0)))
    worst_own = int(np.argmax(np.max(measures.mode_peak, axis=1, initial=0.0)))
    return {
        "architecture": design.architecture,
        "problem": design.problem,
        "gamma": design.gamma,
        "gamma_worst": design.gamma_worst,
        "worst_position_mm": 1e3 * design.worst_position,
        "n_positions": len(design.positions),
        "optimality": design.optimality,
        "status": design.status,
        "seconds": design.seconds,
        "crossover_min_Hz": np.min(measures.crossover, axis=0),
        "crossover_max_Hz": np.max(measures.crossover, axis=0),
        "crossover_mean_Hz": np.mean(measures.crossover, axis=0),
        "sensitivity_peak_dB": decibel(float(np.max(measures.sensitivity_peak))),
        "flexible_peak_dB": decibel(float(np.max(measures.flexible_peak, initial=0.0))),
        "flexible_peak_position_mm": 1e3 * measures.points[worst],
        "mode_peak_dB": decibel(float(np.max(measures.mode_peak, initial=0.0))),
        "mode_peak_position_mm": 1e3 * measures.points[worst_own],
        "damping_min": np.min(measures.damping, axis=0),
        "damping_max": np.max(measures.damping, axis=0),
        "discarded_damping_min": float(np.min(measures.discarded_damping)),
        "K_RB": design.K_RB.arrays(),
        "xi": design.xi,
        "controller_states": design.controller.n_x,
        "multiplications": complexity(design).multiplications,
    }
