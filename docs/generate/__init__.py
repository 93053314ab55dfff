"""Pages and pictures that are generated; ``python docs/generate --help``."""
