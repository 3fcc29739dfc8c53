"""The rig's control loop: state estimator, policy, force guard, sensor monitor and watchdog."""
