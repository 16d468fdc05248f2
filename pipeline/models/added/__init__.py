"""Methods from outside the package, given with `--add` or installed.

added_method has the options of such a method in a recipe, source finds and imports its code, describe reads name,
version and kinds of queries from it, guarded checks its answers, apart runs work with it in a process of its own
(child).
"""
