"""Study ``parking``: cars of any size in bays, gaps, dead ends and lanes, and in the open."""
