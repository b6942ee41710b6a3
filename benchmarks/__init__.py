"""Timings of the numerics as ratios within one run: ``python -m benchmarks``."""
