"""Tables from elsewhere become recordings: what other programs and other laboratories have measured."""
