"""The launcher's window: a session chosen, prepared, started, watched and stopped without a terminal.

`control.py` does the work and knows no Qt; `model.py` and `settings_form.py` are pure; `window.py` and the pages show
them. Everything that the window does is a command that it shows.
"""
