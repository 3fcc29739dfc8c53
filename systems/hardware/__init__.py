"""Models of the rig's hardware: force/torque sensor, depth encoder, stepper motor and DC motor."""
