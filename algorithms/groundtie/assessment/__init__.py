"""How good a transform is, whoever made it: errors at points, consistency, comparison."""
