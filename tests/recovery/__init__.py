"""Known truth in, estimate out, over many seeds: bias, coverage and scatter of every estimator."""
