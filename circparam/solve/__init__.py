"""The numerical core that methods and seams share: energies, block systems, relaxation, Poisson starts."""
