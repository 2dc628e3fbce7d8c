"""A hub's answers to the paths of each subject: the shards are asked, and their answers put together."""
