"""Tutte embeddings: weights, convex boundaries, the solve, and graded weights for thin protrusions."""
