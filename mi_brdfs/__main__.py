"""``python -m mi_brdfs``, the command ``mi-brdfs``."""

from .cli import main

main()
