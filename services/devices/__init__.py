"""Commands of ``netboard devices``: a module for each. Only `group` imports them."""
