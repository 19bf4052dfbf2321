"""What is read of an mbs, and reduced bodies put into one."""
