# SPDX-License-Identifier: Apache-2.0
"""python3 -m egosgm COMMAND: the command `egosgm`."""
from .program import main

main()
