"""Force/torque sensors that people have."""
