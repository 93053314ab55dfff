"""What knows the classes of Mitsuba: registration, the adapters of models and integrators, variants, and LLVM."""
