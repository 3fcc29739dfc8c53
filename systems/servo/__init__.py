"""The servo: device and coupling at 1 kHz in a process of their own, against a local model of the contact."""
