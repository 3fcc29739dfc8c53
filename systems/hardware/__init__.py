"""The rig's hardware models: force/torque sensor, depth encoder, stepper motors and DC motor."""
