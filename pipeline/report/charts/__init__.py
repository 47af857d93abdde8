"""Charts as SVG: axes, bands, curves, maps, bars."""
