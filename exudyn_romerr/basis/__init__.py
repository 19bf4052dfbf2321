"""Bases V and W of reduced bodies, and auxiliary vectors beside them."""
