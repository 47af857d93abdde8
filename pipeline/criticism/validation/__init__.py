"""Where the error of a model lives: maps, trajectories, captures that were held out."""
