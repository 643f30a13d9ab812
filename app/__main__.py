"""``python -m app`` is ``multiview-phd``."""

import sys

from app.command.main import main

sys.exit(main())
