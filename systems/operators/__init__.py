"""Who moves the haptic device: a simulated operator, a person in the browser, or a real device."""
