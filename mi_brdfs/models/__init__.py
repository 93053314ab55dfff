"""The models, one file each: importing the package finds them by themselves."""
