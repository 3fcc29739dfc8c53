"""The rig's control loop: state estimator, policy controller, force guard, sensor monitor and watchdog."""
