"""Parts from CAD: from the files of a peg and of a block with a hole to the geometry of a scenario."""
