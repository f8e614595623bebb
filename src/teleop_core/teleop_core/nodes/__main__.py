"""``python -m teleop_core.nodes NAME`` runs the node of a stage, or a whole session."""

import sys

from teleop_core.nodes.start import main

sys.exit(main())
