"""`summed_area`: tables of the visible area of clusters of yarn, each shaded once; nothing is learnt."""
