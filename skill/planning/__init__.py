"""Planning: the desired next state, what leads there within the learned bounds, and the action that follows."""
