"""Measures of meshes and layouts: intrinsic quantities, exact signs, overlap, distortion, rasters."""
