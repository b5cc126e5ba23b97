"""The recorded hands against another board, another model or another force condition."""
