"""Force feedback: haptic device, haptic proxy with virtual coupling, virtual fixtures and stability."""
