"""``python -m mi_brdfs.cli``"""

import sys

from . import main

sys.exit(main())
