"""Disjunctions over time become a dynamic complementarity system (theory, section 1)."""
