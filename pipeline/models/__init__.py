"""One file per published model, named as the recipes name it."""
