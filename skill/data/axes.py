"""The axes about which a rig turns the block, as its records name them."""

AXES = ("pitch", "yaw", "clocking")
"""From the base of the gimbal to the block; only a rig with a clocking stage has the last one."""
