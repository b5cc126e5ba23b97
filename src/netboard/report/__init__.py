"""What people read: tables of recordings."""
