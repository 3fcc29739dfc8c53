"""The page on which a person demonstrates, corrects the skill, and watches the rig."""
