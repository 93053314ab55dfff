"""``python -m mi_brdfs``, the command ``mi-brdfs``."""

import sys

from .cli import main

sys.exit(main())
