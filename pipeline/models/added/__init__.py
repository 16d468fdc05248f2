"""Methods and metrics from outside the package, given with `--add` or installed.

added_code has their options, source finds and imports their code, describe reads name and version from it, guarded
checks what it returns, network trains its networks and loads them, apart runs work with it in a process of its own.
"""
