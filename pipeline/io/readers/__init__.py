"""Files that are neither MCAP nor text tables: one reader a file, found by the registry."""
