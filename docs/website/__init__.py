"""The site; see ``python docs/website --help``."""
