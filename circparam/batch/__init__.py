"""Many files: listed, handed to Dask's workers, each unwrapped in a process of its own, told in a manifest."""
