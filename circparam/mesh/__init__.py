"""The data: meshes, half-edges, surfaces and cut meshes; repair, and the way back to the file's faces."""
