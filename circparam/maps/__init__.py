"""Maps between two surfaces: for each vertex of one the place on the other, and back."""

from circparam.maps.surface_map import Places, SurfaceMap, load_map, save_map

__all__ = ["Places", "SurfaceMap", "load_map", "save_map"]
