"""All that touches Exudyn: reduced bodies in an mbs, and monitors beside its solves."""
