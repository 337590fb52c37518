"""A registration: from two images and a specification to a verdict, by one list of rules."""
