"""Scripts that are run by hand: figures, the reference of the command line, hashes of outputs."""
