"""Marching through the elements of a system without freedom: start values for the whole problem, or the answer itself."""
