"""The parts of a microfacet model: distributions (D), shadowing (G), Fresnel reflectance (F), and how their product
is sampled."""
