"""The command line: commands and their keys, flags, configuration, sweeps, completion."""
