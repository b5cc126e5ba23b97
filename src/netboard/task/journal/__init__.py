"""The journal of a session: entries, progress, and the check that it belongs to the session to be resumed."""
