"""Methods side by side, each in a process of its own; xatlas as a baseline; Table 1 of the source."""
