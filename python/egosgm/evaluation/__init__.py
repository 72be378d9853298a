# SPDX-License-Identifier: Apache-2.0
"""Maps and poses beside the true ones."""
