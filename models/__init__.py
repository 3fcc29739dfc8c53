"""What exists: geometry, materials, hardware presets and scenarios. Imports nothing of ours."""
