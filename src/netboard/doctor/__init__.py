"""Is this machine fit for a session? What a lab should know before it trusts one."""
