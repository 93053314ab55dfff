"""What the values of a measured file say of themselves."""
