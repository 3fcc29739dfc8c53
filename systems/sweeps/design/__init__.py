"""What a sweep asks for: factors, policies and trials, from a YAML file."""
