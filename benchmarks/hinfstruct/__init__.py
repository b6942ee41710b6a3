"""Structured H-infinity synthesis on the COMPleib systems: ``python -m benchmarks.hinfstruct``."""
