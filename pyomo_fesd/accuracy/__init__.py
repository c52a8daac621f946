"""Accuracy control: rounds of solutions on finer and finer grids, until they agree to a tolerance."""
