"""One sitting of practice, demonstrations, training, and the rig, on the page of a live session."""
