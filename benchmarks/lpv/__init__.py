"""Linear parameter-varying synthesis, structured solver against general ones: ``python -m benchmarks.lpv``."""
