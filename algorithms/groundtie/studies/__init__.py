"""What compares methods: optimisers, detectors, measures. The registering tools use none of it."""
