"""The figures of the paper, one script each: they read results and never solve."""
