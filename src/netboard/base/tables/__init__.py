"""The tables of the configuration, one frozen dataclass each.

Parameters
----------
side : Side
    ``left`` or ``right``: the side of a station.
triggers, form : Triggers, Form
    The tables ``[triggers]`` and ``[form]`` of the configuration.
question : FormQuestion
    A question whose keys are valid.
questions : mapping of str to FormQuestion
    The questions of a form by their id.
event : str
    Name of an event, as a recording has it.
details : mapping of str to str
    What a recording has of this event, by name.
"""
