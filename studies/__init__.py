"""Studies: what reproduces the paper's results. `python -m studies list` names them."""
