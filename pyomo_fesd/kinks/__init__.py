"""Kinks: max, min, abs and their smoothings, written with s = max(0, z) (theory, eq. 8)."""
