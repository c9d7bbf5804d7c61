"""Nesting: masks on a coarse grid, the search on them, and compaction by linear programs."""
