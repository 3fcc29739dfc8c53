"""Systems that record the channels of a demonstration and of a rig run."""
