"""Finite elements whose boundaries find the switches (theory, sections 2 and 3)."""
