"""Many dates of one place: a network of registrations, adjusted as one."""
