"""From a decimated proxy to the fine mesh: decimation, closed holes, transfer of seams and layout."""
