"""Running diagrams: demonstrations, rig trials, practice rounds, and what is measured on them."""
