"""One check a file; `pipeline.crosscheck.registry` finds them by their `RULE`."""
