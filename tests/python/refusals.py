# SPDX-License-Identifier: Apache-2.0
"""Checks that a call is refused, as expect_refused of the C++ tests does."""
import egosgm
import pytest


def expect_refused(words, call):
    """`words`: a regular expression that the refusal holds; empty: any words."""
    with pytest.raises(egosgm.InvalidArgument, match=words or None):
        call()
