"""How a skill acts: what a policy is, imitation, planning, and what watches a policy."""
