"""Import of tables: data from other systems become recordings."""
