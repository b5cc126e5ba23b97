"""Imported tables: data from elsewhere become recordings."""
