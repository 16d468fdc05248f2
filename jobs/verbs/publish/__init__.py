"""The verb `publish`: a data set as a folder that others read and cite.

`publish` checks and writes; `contents` says which rows are in which file; `recipe` writes the generating recipe;
`card` describes the folder for people and for tools.
"""
