"""What is measured on meshes and layouts: intrinsic quantities, exact signs, overlap, distortion, rasters."""
