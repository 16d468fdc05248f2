"""The verb `publish`: a data set as a folder that others read and cite.

`publish` checks and writes, the generating recipe too; `contents` says which rows are in which file; `card` describes
the folder for people and for tools.
"""
