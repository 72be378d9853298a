# SPDX-License-Identifier: Apache-2.0
"""python3 -m egosgm COMMAND: the command `egosgm`."""
from .program import main

if __name__ == "__main__":
    main()
