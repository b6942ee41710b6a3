"""Structured H-infinity synthesis on three sets of problems: ``python -m benchmarks.hinfstruct``."""
