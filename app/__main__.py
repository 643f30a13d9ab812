"""``python -m app`` is ``multiview-phd``."""

import sys

from app.cli import main

sys.exit(main())
