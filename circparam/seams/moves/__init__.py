"""Families of moves that the search for seams chooses from."""
