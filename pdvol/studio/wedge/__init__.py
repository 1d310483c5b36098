"""Many variations of one scene on level 0: sampled, scored, grouped by how they end, and searched."""
