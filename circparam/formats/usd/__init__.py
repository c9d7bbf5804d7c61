"""USD: read as it is composed, written as a stronger layer over the layers of the file."""
