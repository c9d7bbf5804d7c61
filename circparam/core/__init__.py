"""Tools that know no mesh: arrays, graphs, linear systems, tables, the monitor, worker processes, files."""
