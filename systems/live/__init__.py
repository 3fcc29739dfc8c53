"""Live demonstrations: a person moves the peg from the browser or with a haptic device."""
