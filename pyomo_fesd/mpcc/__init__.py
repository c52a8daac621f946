"""Mathematical programs with complementarity constraints and their certified solution (theory, section 4); knows no time."""
