"""One constant's file each; `pipeline.fit.registry` finds them by their `ESTIMATOR`."""
