"""USD: read in its composition, written as a stronger layer over the layers of the file."""
