"""Hard surfaces: charts start from smooth regions at full resolution, flats are never cut."""
