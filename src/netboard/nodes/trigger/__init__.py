"""The process of a trigger box: receives triggers from the server, makes the pulses, and reports each."""
