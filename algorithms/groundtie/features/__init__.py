"""Features: keypoints, their descriptors, and matches between them."""
