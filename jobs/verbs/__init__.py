"""One file a verb of the command line, and the tables that verbs print."""
