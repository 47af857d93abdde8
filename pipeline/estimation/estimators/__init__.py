"""One constant's file each; `pipeline.estimation.registry` finds them by their `ESTIMATOR`."""
