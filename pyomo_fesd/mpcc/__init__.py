"""Mathematical programs with complementarity constraints, and their certified solution (theory, section 4).  Knows nothing of time."""
