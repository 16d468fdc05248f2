"""The verb `publish`: a data set as a folder that others read and cite.

`publish` checks and writes; `contents` says which rows are in which file; `recipe` writes the generating recipe;
`card`, `croissant` and `citation` describe the folder for people, for tools and for references; `licence` knows the
names of licences.
"""
