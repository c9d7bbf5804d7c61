"""The way through: options, stages in order, the fallback cascade, verification, results."""
