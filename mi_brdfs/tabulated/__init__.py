"""The plugin that renders measured files, and its tables in kernels."""
