"""What a run tells: the summary, its table, pictures and pages."""
