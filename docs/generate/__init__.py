"""Generated pages and pictures; see ``python docs/generate --help``."""
