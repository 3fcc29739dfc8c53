"""Force feedback: the haptic device, the proxy with its virtual coupling, fixtures and stability."""
