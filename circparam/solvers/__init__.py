"""The numerical core of methods and seams: energies, relaxation, Poisson and Tutte embeddings, untangling."""
