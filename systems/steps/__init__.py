"""What each element between sensor and motors does in one period, as compiled functions without Drake.

A step takes parameters (a named tuple), the state (an array whose places the module names, or a named tuple) and
inputs, and returns the next state. It does not change its arguments. The systems of `systems.control` and
`systems.hardware` declare ports and call the steps.
"""
