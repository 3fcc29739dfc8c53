"""The contact against theory, finer discretisation and MuJoCo."""
