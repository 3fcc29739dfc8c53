"""What stands between the sensors and the motors: each part with its limits, its compiled step and its system."""
