"""Many files: listed, sent to Dask workers, each unwrapped in a process of its own, recorded in a manifest."""
