"""Charts grown, merged, shortened and held to the bound on one surface."""
