"""Operators of the haptic device: a simulated one, a person in the browser, and a person with a real device."""
