"""Many dyads at one server, with lightweight peers."""
