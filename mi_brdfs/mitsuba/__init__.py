"""All code that depends on Mitsuba's classes: registration, the adapters of models and integrators, and LLVM."""
